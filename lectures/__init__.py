"""The course: a folder of four files for each lecture, and its line in `outline`. See AUTHORS.md."""
