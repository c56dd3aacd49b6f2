"""Seeds, questions and expected answers of a class: written and read."""

import hashlib
import inspect
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from workbench.course.checks import Raised, outcome
from workbench.course.packs.variants import Arguments, Numbers, PackExercise
from workbench.course.plain import Malformed, decode, encode
from workbench.errors import BadFile
from workbench.writing import write_file

KEYS, QUESTIONS = "keys.json", "questions.json"
FORMAT = 2  # of these files
HIDDEN_SETS = 6  # of arguments, which only the key has
EXAMPLE_SETS = 2  # of arguments, which the student sees
MOST_DRAWS = 100  # times that numbers are drawn anew because another student has the same
OF_THE_LECTURE = "this answers the exercise as it stands in the lecture, and not this one"


@dataclass(frozen=True)
class ExerciseKey:
    """What one student's answer to one exercise is marked by.

    `tries`, `edges` and `examples` are lists of pairs: the arguments, and the answer, as
    `plain.encode` writes them. The answers of mistakes are those to `tries`.
    """

    number: str  # as it is printed, such as `4.2`
    sheet: str  # the name of the file that it stands in, without its ending
    exercise: str  # the name of the function
    parameters: list[str]  # the names of its arguments
    points: int  # how many points it is worth
    minutes: int  # how long it takes, as was estimated
    within: float  # the largest relative error
    numbers: Numbers  # the student's own numbers
    tries: list[Any]  # what is worth all points but that of the edges
    edges: list[Any]  # what is worth one point, or nothing if there are none
    examples: list[Any]  # what the student sees
    mistakes: list[Any]  # pairs of a hint and answers


@dataclass(frozen=True)
class ClassKey:
    """The keys of a class."""

    group: str  # the name of the class
    seed: int  # from which all numbers were drawn
    students: dict[str, str]  # the names of the students, by the names of their folders
    titles: dict[str, str]  # the titles of the files, by name
    keys: dict[str, list[ExerciseKey]]  # the keys of each student, by the name of the folder

    @property
    def exercises(self) -> list[ExerciseKey]:
        """The exercises, as the first student has them."""
        return next(iter(self.keys.values()))


def make_keys(
    group: str, seed: int, students: dict[str, str], exercises: list[PackExercise]
) -> ClassKey:
    """Draw the numbers of every student, and compute all answers."""
    keys: dict[str, list[ExerciseKey]] = {folder: [] for folder in students}
    for exercise in exercises:
        drawn: list[Numbers] = []
        for folder in students:
            names = group, folder, exercise.number
            for k in range(MOST_DRAWS):
                numbers = exercise.variant.draw(generator(seed, *names, "numbers", k))
                if numbers not in drawn:
                    break
            drawn.append(numbers)
            keys[folder].append(_key(exercise, numbers, seed, names))
    titles = {exercise.sheet: exercise.title for exercise in exercises}
    return ClassKey(group, seed, students, titles, keys)


def _key(
    exercise: PackExercise, numbers: Numbers, seed: int, names: tuple[str, ...]
) -> ExerciseKey:
    variant = exercise.variant

    def answered(arguments: Arguments) -> Any:
        return variant.solution(*arguments, **numbers)

    def some(what: str, count: int) -> list[Arguments]:
        rng = generator(seed, *names, what)
        return [variant.arguments(rng, numbers) for _ in range(count)]

    def pairs(these: list[Arguments]) -> list[Any]:
        return [[encode(list(arguments)), encode(answered(arguments))] for arguments in these]

    tries = some("tries", HIDDEN_SETS)
    mistakes = [[m.hint, _mistaken(m.answer, tries, numbers)] for m in exercise.mistakes]
    if exercise.published is not None:
        lecture = exercise.published.solution(variant.exercise)
        mistakes.append([OF_THE_LECTURE, _mistaken(lecture, tries, {})])
    return ExerciseKey(
        exercise.number,
        exercise.sheet,
        variant.exercise,
        variant.parameters,
        variant.points,
        variant.minutes,
        variant.within,
        numbers,
        pairs(tries),
        pairs(list(variant.edges(numbers))),
        pairs(some("examples", EXAMPLE_SETS)),
        [[hint, answers] for hint, answers in mistakes if answers],
    )


def _mistaken(answer: Any, tries: list[Arguments], numbers: Numbers) -> list[Any]:
    """A wrong function's answers, or none if it cannot answer."""
    answers = [outcome(lambda *a: answer(*a, **numbers), arguments) for arguments in tries]
    if any(isinstance(answered, Raised) for answered in answers):
        return []
    return [encode(answered) for answered in answers]


def write_keys(key: ClassKey, exercises: list[PackExercise], folder: Path) -> None:
    """Write the keys of a class, and its right answers to read, to a folder that exists.

    `questions.json` is the same without any answer: what is needed to run the files of students
    where the keys are not.
    """
    for exercise in exercises:
        text = f"# to this exercise\n\n{inspect.getsource(exercise.variant.solution)}"
        if exercise.published is not None:
            lecture = exercise.published.solution(exercise.variant.exercise)
            text += f"\n\n# to that of the lecture\n\n{inspect.getsource(lecture)}"
        write_file(folder / f"answer-{exercise.number}-{exercise.variant.exercise}.py", text)
    data = {"format": FORMAT, **asdict(key)}
    write_file(folder / KEYS, json.dumps(data, indent=1, ensure_ascii=False))
    for entries in data["keys"].values():
        for entry in entries:
            for pairs in ("tries", "edges", "examples"):
                entry[pairs] = [[arguments, None] for arguments, _ in entry[pairs]]
            entry["mistakes"] = []
    write_file(folder / QUESTIONS, json.dumps(data, indent=1, ensure_ascii=False))


def read_keys(folder: Path, name: str = KEYS) -> ClassKey:
    """The keys of a class, or its questions. Raises BadFile if there are none, or damaged ones."""
    path = folder / name
    if not path.is_file():
        raise BadFile(
            f"there is no file {path}; --keys takes the folder of keys that `workbench lecture "
            "pack` wrote beside the pack"
        )
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        if data.pop("format", 1) != FORMAT:
            raise ValueError("it was made by another version")
        data.pop("sources", None)  # of older packs
        keys = {
            str(student): [ExerciseKey(**exercise) for exercise in exercises]
            for student, exercises in data["keys"].items()
        }
        key = ClassKey(**{**data, "keys": keys})
        for exercise in (exercise for exercises in keys.values() for exercise in exercises):
            for arguments, answer in (*exercise.tries, *exercise.edges):
                decode(arguments), decode(answer)
        if not keys or set(keys) != set(key.students) or not all(keys.values()):
            raise ValueError("students without keys")
    except (KeyError, TypeError, ValueError, AttributeError, Malformed) as error:
        raise BadFile(f"{path} is damaged: {error}; make the pack again with its seed") from error
    return key


def generator(seed: int, *names: str | int) -> np.random.Generator:
    """A generator of random numbers for these names, such as class, student and exercise."""
    text = json.dumps([seed, *names], ensure_ascii=False)
    digest = hashlib.sha256(text.encode("utf-8")).digest()
    return np.random.default_rng(int.from_bytes(digest[:16], "big"))
