"""fit_capsules makes the capsules of a body of your own."""

from dataclasses import replace

import workbench as wb
from workbench.bodies import fit_capsules

body = replace(wb.load_body("small"), capsules=None)
body = replace(body, capsules=fit_capsules(body, people=20))
print(len(body.capsules.names), "capsules,", len(body.capsules.pairs), "pairs")
