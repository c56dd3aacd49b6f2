"""The plans for courses: lectures come after those that they assume, and minutes add up."""

import re

from workbench.course.outline import course, lecture, root
from workbench.course.packs.variants import chosen_exercises

TEXT = (root() / "PLANS.md").read_text(encoding="utf-8")
PLANS = {part.split("\n", 1)[0]: part for part in TEXT.split("\n## ")[1:]}
WEEKS = {"Six": 6, "Ten": 10, "Fourteen": 14}


def rows(plan: str) -> list[list[str]]:
    lines = [line for line in plan.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def assumed(number: int) -> set[int]:
    """The lectures that a lecture assumes, from the outline."""
    text = lecture(number).assumes
    return set().union(*map(numbers_in, re.findall(r"lectures? ([\d ,andto]+)", text)))


def numbers_in(text: str) -> set[int]:
    found = {int(n) for n in re.findall(r"\d+", text)}
    for low, high in re.findall(r"(\d+) to (\d+)", text):
        found |= set(range(int(low), int(high) + 1))
    return found


def test_short_courses_of_the_guide_contain_what_they_assume() -> None:
    guide = (root() / "GUIDE.md").read_text(encoding="utf-8")
    found = re.findall(r"^\| on (\w+) \| (.+) \|$", guide, re.M)
    assert len(found) == 4
    for name, said in found:
        numbers = numbers_in(said)
        for number in numbers:
            assert assumed(number) <= numbers, f"{name}: lecture {number} assumes {assumed(number)}"


def test_plans_can_be_taught() -> None:
    assert len(PLANS) == 3
    for name in PLANS:
        can_be_taught(name)


def can_be_taught(name: str) -> None:
    *weeks, total = rows(PLANS[name])
    assert [int(week[0]) for week in weeks] == list(range(1, WEEKS[name.split()[0]] + 1))
    before: set[int] = set()
    for _, lectures, in_class, exercises, at_home in weeks:
        for number in map(int, lectures.split(",")):
            needed = assumed(number) - before
            assert not needed, f"lecture {number} assumes {needed}, which came not before"
            before.add(number)
        now = [lecture(int(n)) for n in lectures.split(",")]
        assert int(in_class) == sum(one.minutes for one in now)
        some = chosen_exercises(exercises.split())
        assert int(at_home) == sum(one.variant.minutes for one in some)
        assert {one.published.number for one in some if one.published} <= {n.number for n in now}
    assert int(total[2]) == sum(int(week[2]) for week in weeks)
    assert int(total[4]) == sum(int(week[4]) for week in weeks)
    if name.startswith("Fourteen"):
        assert before >= {one.number for one in course() if one.number <= 17}
