"""The process of a file that is marked: `python -m workbench.course.packs.confined_process FILE
EXERCISES HANDLE`.

It is an answer process that may do less.
"""

from workbench.course.answer_process import main
from workbench.course.packs.confinement import confine

if __name__ == "__main__":
    main(confine)
