"""One file of keypoints for all images of a clip, taken apart by image.

AlphaPose writes such a file: a list of people, each with the name of its image, or, in the forms
that imitate OpenPose, an object with an entry for each image (Fang et al., AlphaPose, 2022). Files
of annotations in COCO's form, with a list of images, are such files too.
"""

import re
from pathlib import Path
from typing import Any

from workbench.errors import BadFile, shown

PEOPLE = ("people", "bodies")  # what an entry of an image holds, as OpenPose and AlphaPose call it


def number_in(name: Any) -> int | None:
    """The last number in the name of an image or of a file, or the number that it is."""
    if type(name) is int and 0 <= name < 10**12:
        return name
    digits = re.findall(r"\d{1,12}", Path(name).stem) if isinstance(name, str) else []
    return int(digits[-1]) if digits else None


def by_image(path: Path, data: Any) -> dict[int, Any]:
    """What the file says of each image, by the number in the image's name, in order.

    Each entry has the form of a file on one image. Raises BadFile if the file does not say which
    image a person is in.
    """
    found: dict[int, Any] = {}
    if isinstance(data, list) and data:
        for i, one in enumerate(data):
            name = one.get("image_id") if isinstance(one, dict) else None
            found.setdefault(_number(path, f"[{i}]", name), []).append(one)
    elif isinstance(data, dict) and isinstance(data.get("annotations"), list):
        return _annotated(path, data)
    elif isinstance(data, dict) and data and all(_of_people(one) for one in data.values()):
        for name, one in data.items():
            number = _number(path, "an entry", name)
            if number in found:
                raise BadFile(f"{path}: two images have the number {number}, in {shown(name)} too")
            found[number] = one
    else:
        raise BadFile(
            f"{path} does not say which image a person is in; give a file of AlphaPose or COCO "
            "with an `image_id` for each person, or a folder with a file for each frame"
        )
    return dict(sorted(found.items()))


def _annotated(path: Path, data: dict[str, Any]) -> dict[int, Any]:
    """The annotations of each image of COCO's form, numbered by file names if all have numbers."""
    images = data.get("images", [])
    if not isinstance(images, list) or not all(isinstance(one, dict) for one in images):
        raise BadFile(f"{path}: images must be a list of objects, not {shown(images)}")
    known = {str(one.get("id")): one for one in images}
    numbers = {name: number_in(one.get("file_name")) for name, one in known.items()}
    named = None not in numbers.values() and len({*numbers.values()}) == len(numbers)
    found: dict[int, Any] = {}
    for i, one in enumerate(data["annotations"]):
        name = one.get("image_id") if isinstance(one, dict) else None
        own = known.get(str(name))
        number = numbers[str(name)] if named and own is not None else None
        if number is None:
            number = _number(path, f"annotations[{i}]", name)
        empty = {"images": [] if own is None else [own], "annotations": []}
        found.setdefault(number, empty)["annotations"].append(one)
    return dict(sorted(found.items()))


def _number(path: Path, where: str, name: Any) -> int:
    number = number_in(name)
    if number is None:
        raise BadFile(
            f"{path}: {where} is of image {shown(name)}, and the name of a frame's image holds its "
            "number, such as frame_012.jpg"
        )
    return number


def _of_people(entry: Any) -> bool:
    return isinstance(entry, dict) and any(key in entry for key in PEOPLE)
