"""Changes of what a drive log is taken for that change no result: file, change as it is told, and the reason."""

DRIVE_LOG: dict[tuple[str, str], str] = {
    (
        "rover_pin/experiments/drive_log/experiment.py",
        'return list(telling(results(function, asked, self.jobs, short=True), len(asked), "replays")): True -> False',
    ): "how many replays a process is handed at once",
}
