"""The course. Each lecture is a folder of four files; they come with the parts they teach."""
