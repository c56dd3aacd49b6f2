"""The line of this lecture in the outline of a course."""

from workbench.course.outline import Lecture

LECTURE = Lecture(
    0,  # its number, which is also in the name of this folder
    "NAME",
    "One wrong measurement",
    question="How far can a single wrong measurement move an estimate?",
    minutes=20,
    assumes="means, medians and derivatives of functions of one variable",
    teaches="the influence of an outlier on a mean and on Huber's estimate",
)
