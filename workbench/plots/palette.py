"""The colours of every figure: told apart by colour-blind readers, and in grey.

Okabe and Ito, Color Universal Design (2008), without its yellow, which is too pale for lines.
"""

INK = "#222222"
FAINT = "#8a8f98"  # frames, grids, what is only context
BLUE = "#0072B2"
VERMILLION = "#D55E00"
GREEN = "#009E73"
PURPLE = "#CC79A7"
ORANGE = "#E69F00"
SKY = "#56B4E9"

LINES = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, INK, FAINT)
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*", "h")
DASHES = ("-", "--", "-.", ":")

SKIN = "#d3dce6"  # a shaded body: pale, so that marks on it stand out
OUTSIDE = "#eceef1"  # beyond the frame of an image
AMOUNT = "cividis"  # the colour map of magnitudes
