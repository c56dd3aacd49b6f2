"""What is wrong with the file of a body model, in sentences that say what to do about it.

A check is a function from `ModelArrays`, which reads each array by itself, to findings: `numbers`
(sums, faces, landmarks), `trees` (the order of joints), `places` (unit, axes, sides), `spaces`
(betas), `hands` (sides and mean poses) and, of two files, `pairs`. To add one, write such a
function and a faulty file for its test; the embedded bodies must stay without findings.
"""
