"""What the rules of windows need to know about a window."""

WINDOWS = {
    name: entry
    for name, entry in config["windows"][SOURCE_OF_SEQUENCES].items()
    if not (EUROC_ROOT and "only" in config["euroc"]) or entry["sequence"] in USED
}
for name, entry in WINDOWS.items():
    known = config["euroc"]["sequences"] if EUROC_ROOT else config["rendered"]
    if entry["sequence"] not in known:
        raise WorkflowError(
            f"configuration, windows.{SOURCE_OF_SEQUENCES}.{name}.sequence: must be one of {', '.join(known)}"
            f" (found {entry['sequence']!r})"
        )


def window_sequence(wildcards):
    """Name of the sequence whose settings a window has."""
    sequence = WINDOWS[wildcards.window]["sequence"]
    return sequence if EUROC_ROOT else f"rendered_{sequence}"


def window_folder(wildcards):
    entry = WINDOWS[wildcards.window]
    if not EUROC_ROOT:
        return f"data/rendered/{window_sequence(wildcards)}"
    folder = entry.get("folder", config["euroc"]["sequences"][entry["sequence"]]["folder"])
    return str(Path(EUROC_ROOT) / folder)


def window_truth(wildcards, purpose):
    """Name of the ground-truth folder of a window: the first of its sequence's that it has."""
    mav0 = Path(window_folder(wildcards), "mav0")
    if not EUROC_ROOT:
        return "state_groundtruth_estimate0"
    choices = config["euroc"]["sequences"][window_sequence(wildcards)][purpose]
    existing = [choice for choice in choices if (mav0 / choice / "data.csv").is_file()]
    return (existing or choices)[0]


def window_settings(wildcards):
    """Front-end settings of a window, as JSON: its sequence's, with another part of the recording."""
    entry = WINDOWS[wildcards.window]
    settings = json.loads(sequence_section(window_sequence(wildcards), "front_end"))
    names = {"start_s": "window_start_s", "end_s": "window_end_s", "count": "count"}
    changes = {theirs: entry[ours] for ours, theirs in names.items() if ours in entry}
    settings["keyframes"] = settings.get("keyframes", {}) | changes
    settings |= {key: entry[key] for key in ("tracker",) if key in entry}
    return json.dumps(settings, sort_keys=True)


def window_files(wildcards):
    folder = Path(window_folder(wildcards))
    if not EUROC_ROOT:
        return [str(folder / "rendered.json")]
    truths = {window_truth(wildcards, purpose) for purpose in ("truth", "biases")}
    sensors = [f"{s}/{f}" for s in ("cam0", "cam1", "imu0") for f in ("data.csv", "sensor.yaml")]
    return [
        str(folder / "mav0" / file) for file in [*sensors, *sorted(f"{truth}/data.csv" for truth in truths)]
    ]
