"""Size of a walking person: the home of its figures, for cameras, detectors, the engine, drawings and exports."""

# m, height of the one point that stands for a person: half of a walking person's 1.7 m.
TARGET_HEIGHT = 0.85
PERSON_HEIGHT = 2 * TARGET_HEIGHT  # m
PERSON_RADIUS = 0.25  # m, radius of the cylinder that stands for a person where a plain shape will do
PERSON_SIZE = (2 * PERSON_RADIUS, 2 * PERSON_RADIUS, PERSON_HEIGHT)  # m, of the box around that cylinder
ENCLOSING_CYLINDER = (0.5, 1.75)  # m, radius and height of an upright cylinder that encloses a person
ENCLOSING_RADIUS = 1.1  # m, of a sphere around the middle that encloses a person
AREA_FROM_ABOVE = 0.27  # m², mean area of a person seen from straight above: that of `SILHOUETTE`

# m² and m: mean area of a person's silhouette from above, and what each metre adds by which the head is seen beside the
# feet. Fitted to renderings of a walking person at all headings, from nadir to 40 degrees off nadir.
AREA_ON_TOP, AREA_BY_HEIGHT = 0.2, 0.22

# Mean outline over all headings, as three horizontal circles: height above ground, radius [m].
OUTLINE = ((0.0, 0.25), (1.4, 0.23), (1.7, 0.08))

# Cover over all headings, as horizontal circles: height above ground [m], radius [m], and the share of headings at
# which the body between the circle below and this one hides the background; it is small for thin legs.
SILHOUETTE = (
    (0.00, 0.36, 0.00),
    (0.30, 0.34, 0.22),
    (0.60, 0.31, 0.35),
    (0.85, 0.29, 0.50),
    (1.10, 0.29, 0.65),
    (1.42, 0.28, 0.82),
    (1.55, 0.11, 0.85),
    (1.70, 0.09, 0.90),
)
