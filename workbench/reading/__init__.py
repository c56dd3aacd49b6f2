"""Reading files that may be damaged: archives of arrays, what they must hold, facts in JSON.

A reader declares what it expects as data, `{"template": reals("N", 3), "faces": wholes("F", 3)}`,
in which the same letter always stands for the same size; only arrays that fit are read, and
converted to float64. What an array claims of itself is compared with the size of the file before
memory is set aside, and facts in JSON are checked alike (`facts`). Every error of NumPy or zipfile
becomes a sentence that names the file and the array (`damage`). `np.load` is called nowhere.
"""
