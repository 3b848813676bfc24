"""Changes of the identification that change no result."""

HERE = "rover_pin/identification/"
OF_TWO = "of the names k_1 and k_2 the second is the last"
MOST = "no more sets have a number than there are sets"
DOUBT = "what is no declared SD is assumed, which comes before it in the alphabet"

IDENTIFICATION: dict[tuple[str, str], str] = {
    (
        f"{HERE}held.py",
        'alike = ", every set\'s alike" if len(names) == len(rigs) else "": == -> >=',
    ): MOST,
    (
        f"{HERE}one_sand.py",
        """whose = "" if len(names) == count else f" of {' and '.join(names)}": == -> >=""",
    ): MOST,
    (
        f"{HERE}held.py",
        "rows = [(rig.name, _Given(rig, soil, {}, rig.known, soil, True).held(size)) for rig in rigs]: True -> False",
    ): "how many widths there are is asked of moduli, not of sizes",
    (
        f"{HERE}held.py",
        "return Held(name, about.unit, value, self._source(name), low, high, doubt, ends, doubt == STATED): == -> >=",
    ): DOUBT,
    (
        f"{HERE}held.py",
        'return Held("k_1 + k_2 b", "Pa", value, self._source(by), low, high, doubt, ends, doubt == STATED): == -> >=',
    ): DOUBT,
    (
        f"{HERE}held.py",
        'other, b = ("k_1" if name == "k_2" else "k_2"), float(self.data.wheel.b): == -> >=',
    ): OF_TWO,
    (
        f"{HERE}held.py",
        'most = float(modulus(self.data.wheel, self.soil)) / (b if name == "k_2" else 1.0): == -> >=',
    ): OF_TWO,
    (
        f"{HERE}arc_doubt.py",
        "loaded = any(each.loads.size for each in sets): any -> all",
    ): "several sets are rigs, all of whose rows have a load",
    (
        f"{HERE}result.py",
        "if held.low == held.high:: == -> >=",
    ): "no range ends before it begins",
    (
        f"{HERE}result.py",
        'return in_words(unit) if unit == "rad" else (1.0, unit): == -> >=',
    ): "of the units that a reader wants otherwise rad is the last in the alphabet",
    (
        f"{HERE}dependence.py",
        "if not callable(change) and not change:: not callable(change) -> (callable(change))",
    ): "no number changed, no prediction changes",
    (
        f"{HERE}dependence.py",
        "own = [dataclasses.replace(one, wheel=one.wheel.replace(**sizes)) for one in sets] if sizes else sets  "
        "# type: ignore[type-var]: "
        "sets -> ([dataclasses.replace(one, wheel=one.wheel.replace(**sizes)) for one in sets])",
    ): "a wheel none of whose sizes is changed is the same",
    (
        f"{HERE}dependence.py",
        "return max(shift / high if shift > 0 else -shift / low for shift in shifts): > -> >=",
    ): "what does not move is no part of either side",
    (
        f"{HERE}dependence.py",
        "for count in range(2, len(order) + 1):: 1 -> 2",
    ): "one more than all are all",
}
