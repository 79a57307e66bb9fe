#!/usr/bin/env python3
"""Recomputes the published numbers that a command makes in about a minute, and compares them with the pages.

    docs/check_numbers.py [--noisefloor target/debug/noisefloor]     compares; exit code 1 if a number is wrong
    docs/check_numbers.py --write                                    puts the recomputed numbers into the pages

A page marks such a number, or a table of them, as `<!--=KEY-->×1.28<!--/-->`; the functions of `VALUES` say what
each key is and which command makes it. The README is read as it is, too, so its numbers are found by the words
around them instead: `ANCHORS`. All other numbers carry their date and command on the page.

A number may differ by one unit of its last digit or by 1 %: the solver ends within 1e-3 of the optimum, and on
another machine `exp` may round otherwise on the way there. On one machine the numbers are the same every time.
"""

import argparse
import csv
import functools
import json
import math
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
PAGES = ["docs/accuracy.md", "docs/guide.md", "docs/reference.md"]
TABLE = "fixtures/human-table.csv"
MARK = re.compile(r"<!--=(?P<key>[\w.-]+)-->(?P<text>.*?)<!--/-->", re.DOTALL)
# Lines of README.md, with the key of each number in braces.
ANCHORS = [
    "People judged {table.zones} zones of {table.scenes} scenes.",
    "| **noisefloor** | **{nested.error}** | {nested.bias} | {nested.early} | {nested.images} |",
    "| one noise level for all scenes | {constant.error} | {constant.bias} | {constant.early} | {constant.images} |",
    "| median of the *same* scene's other zones | {median.error} | {median.bias} | {median.early} | {median.images} |",
    "The worst scene errs by {worst.error}; with other scenes like these, the error would lie between {nested.low} and "
    "{nested.high}",
    "Of the zones, {nested.below} stop below what the mean person asked for.",
]
KEY = re.compile(r"\{([\w.]+)\}")
NUMBER = re.compile(r"\d+(?:,\d{3})*(?:\.\d+)?")

# What `evaluate --without` leaves out, and how accuracy.md calls the rest.
ABLATIONS = [
    ("the tile's noise, its picture's noise and light", []),
    ("without light", ["picture_light"]),
    ("only the tile's noise", ["picture_noise", "picture_light"]),
]


def run(program, *args):
    """Standard output of a command, which must succeed."""
    return subprocess.run([program, *args], cwd=ROOT, check=True, text=True, stdout=subprocess.PIPE).stdout


@functools.cache
def evaluate(*options, table=TABLE):
    """The report of `noisefloor-lab evaluate`, and its zones."""
    with tempfile.TemporaryDirectory() as folder:
        report, zones = f"{folder}/scores.json", f"{folder}/zones.csv"
        run(noisefloor + "-lab", "evaluate", "--table", table, *options, "--json", report, "--csv", zones)
        with open(report) as scores, open(zones) as lines:
            return json.load(scores), list(csv.DictReader(lines))


def nested():
    """The vision model, with everything chosen without the scene that is scored."""
    return evaluate("--nested", table="fixtures/human-choices.csv")[0]


def unseen():
    """The bundled model's constants, which were chosen on all scenes."""
    return evaluate("--leave-one-scene-out")[0]


def nine_scenes():
    """Error over the scenes of LISIC."""
    zones = [z for z in evaluate("--nested", table="fixtures/human-choices.csv")[1] if "-view" not in z["scene"]]
    off = [abs(math.log(float(z["predicted_spp"]) / float(z["human_spp"]))) for z in zones]
    return math.exp(statistics.mean(off))


def ablated(names):
    return evaluate("--leave-one-scene-out", *(["--without", ",".join(names)] if names else []))[0]


@functools.cache
def inspect():
    return json.loads(run(noisefloor, "inspect", "--json"))


def factor(number):
    return f"×{number:.2f}"


def share(number, digits=0):
    return f"{100 * number:.{digits}f} %"


def worst(scores):
    return max(scores["scenes"], key=lambda scene: scene["error_factor"])


def table(head, rows):
    lines = [head, ["---"] * len(head), *rows]
    return "\n\n" + "\n".join("| " + " | ".join(cells) + " |" for cells in lines) + "\n\n"


def scene_table():
    """Scores of each scene, held out."""
    def row(scores):
        constant, median = (scores["baselines"][kind] for kind in ("constant", "scene_median"))
        return [
            scores["scene"], factor(scores["error_factor"]), factor(scores["bias_factor"]),
            share(scores["early_share"]), share(scores["image_accuracy"], 1),
            f"{factor(constant['error_factor'])}, {share(constant['early_share'])}",
            factor(median["error_factor"]),
        ]
    head = ["scene", "error", "bias", "early", "pictures right", "one noise level for all scenes: error, early",
            "the scene's own median: error"]
    return table(head, [row(scores) for scores in [*nested()["scenes"], {**nested(), "scene": "**all**"}]])


def ablation_table():
    """Scores without some numbers of the descriptor."""
    def row(name, names):
        scores = ablated(names)
        return [
            name, f"`{','.join(names)}`" if names else "", factor(scores["error_factor"]),
            factor(scores["bias_factor"]), share(scores["early_share"]),
            factor(worst(scores)["error_factor"]), f"{scores['calibration_error']:.3f}",
        ]
    head = ["descriptor", "`--without`", "error", "bias", "early", "worst scene", "calibration error"]
    return table(head, [row(*ablation) for ablation in ABLATIONS])


def threshold_table():
    """Mean thresholds of people and models: Table 1 of the paper."""
    learned, held_out = evaluate()[1], evaluate("--leave-one-scene-out")[1]
    def mean(zones, column, scene=None):
        numbers = [float(zone[column]) for zone in zones if scene in (None, zone["scene"])]
        return f"{sum(numbers) / len(numbers):,.0f}"
    def row(name, scene=None):
        return [name, mean(learned, "human_spp", scene), mean(learned, "predicted_spp", scene),
                mean(held_out, "predicted_spp", scene)]
    scenes = list(dict.fromkeys(zone["scene"] for zone in learned))
    rows = [*(row(scene, scene) for scene in scenes), row("mean")]
    return table(["scene", "people", "model, learned", "model, unseen"], rows)


def noise_table():
    """What the example prints about noise of other kinds."""
    built = pathlib.Path(noisefloor).parent / "examples/noise_colours"
    command = [built] if built.exists() else ["cargo", "run", "--quiet", "-p", "noisefloor", "--example", built.name]
    return "\n\n" + run(*command).strip() + "\n\n"


def scores_of(prefix, scores):
    """The keys of one predictor."""
    return {
        f"{prefix}.error": lambda: factor(scores()["error_factor"]),
        f"{prefix}.bias": lambda: factor(scores()["bias_factor"]),
        f"{prefix}.early": lambda: share(scores()["early_share"]),
        f"{prefix}.images": lambda: share(scores()["image_accuracy"], 1),
    }


def below_the_mean():
    """Share of zones that stop below what the mean person asked for."""
    zones = evaluate("--nested", table="fixtures/human-choices.csv")[1]
    return share(statistics.mean(float(z["stop_spp"]) < float(z["human_spp"]) for z in zones))


def to_95_percent(people):
    """From the mean observer to 95 % of people, in samples: thresholds are normal in ln(spp), and their mean exp(s^2/2)
    of the median's."""
    spread = math.hypot(inspect()["spread"]["scenes"], people)
    return factor(math.exp(statistics.NormalDist().inv_cdf(0.95) * spread - people**2 / 2))


VALUES = {
    **scores_of("nested", nested),
    **scores_of("constant", lambda: nested()["baselines"]["constant"]),
    **scores_of("median", lambda: nested()["baselines"]["scene_median"]),
    "unseen.error": lambda: factor(unseen()["error_factor"]),
    "unseen.unfamiliar": lambda: f"{unseen()['unfamiliar_zones']}",
    "nested.calibration": lambda: f"{nested()['calibration_error']:.3f}",
    "nine.error": lambda: factor(nine_scenes()),
    "worst.scene": lambda: worst(nested())["scene"],
    "worst.error": lambda: factor(worst(nested())["error_factor"]),
    "table.zones": lambda: f"{unseen()['zones']}",
    "table.scenes": lambda: f"{len(unseen()['scenes'])}",
    "table.real": lambda: f"{unseen()['levels_real']:,}",
    "table.synthesised": lambda: f"{unseen()['levels_synthesised']:,}",
    "inspect.error": lambda: factor(inspect()["record"]["leave_one_scene_out"]["error_factor"]),
    "inspect.familiar": lambda: f"{inspect()['familiar_reach']:.2f}",
    "inspect.scenes": lambda: f"{inspect()['spread']['scenes']:.2f}",
    "inspect.to95": lambda: to_95_percent(inspect()["spread"]["people"]),
    "inspect.to95low": lambda: to_95_percent(0.4),
    "inspect.to95high": lambda: to_95_percent(0.7),
    "nested.below": below_the_mean,
    "nested.low": lambda: factor(nested()["error_interval"][0]),
    "nested.high": lambda: factor(nested()["error_interval"][1]),
    "tables.scenes": scene_table,
    "tables.ablation": ablation_table,
    "tables.thresholds": threshold_table,
    "tables.noise": noise_table,
}


def number(text):
    """A printed number, and one unit of its last digit."""
    digits = text.replace(",", "")
    return float(digits), 10.0 ** -len(digits.partition(".")[2])


def agree(printed, computed):
    """Whether all numbers agree, and the words between them are the same."""
    if NUMBER.split(printed) != NUMBER.split(computed):
        return False
    for ours, theirs in zip(NUMBER.findall(printed), NUMBER.findall(computed)):
        (a, unit), (b, _) = number(ours), number(theirs)
        if abs(a - b) > max(1.001 * unit, 0.01 * abs(b)):
            return False
    return True


def check(page, write):
    """Compares the marked numbers of a page, and puts the right ones there if asked to. Returns what is wrong."""
    path = ROOT / page
    before = path.read_text()
    wrong = []

    def replace(mark):
        key, printed = mark["key"], mark["text"]
        if key not in VALUES:
            wrong.append(f"{page}: no command makes `{key}`; see VALUES in docs/check_numbers.py")
            return mark[0]
        computed = VALUES[key]()
        if not agree(printed, computed):
            line = 1 + before.count("\n", 0, mark.start())
            wrong.append(f"{page}:{line}: {key} is printed as {printed.strip()}\nand computed as {computed.strip()}")
        return f"<!--={key}-->{computed}<!--/-->"

    after = MARK.sub(replace, before)
    if before.count("<!--=") != len(MARK.findall(before)):
        wrong.append(f"{page}: a mark `<!--=…-->` has no end `<!--/-->`")
    if write:
        path.write_text(after)
    return wrong


def check_readme(write):
    """Compares the numbers of the README. Returns what is wrong."""
    path = ROOT / "README.md"
    text = path.read_text()
    wrong = []
    for anchor in ANCHORS:
        words = [re.escape(part) for part in KEY.split(anchor)[::2]]
        found = re.search("(×?[0-9.,]+(?: %)?)".join(words), text)
        if not found:
            wrong.append(f"README.md: no line reads `{anchor}`; see ANCHORS in docs/check_numbers.py")
            continue
        right = KEY.sub(lambda key: VALUES[key[1]](), anchor)
        if not agree(found[0], right):
            wrong.append(f"README.md: it reads\n{found[0]}\nand computed is\n{right}")
        text = text.replace(found[0], right)
    if write:
        path.write_text(text)
    return wrong


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--noisefloor", default="target/debug/noisefloor", help="the command")
    parser.add_argument("--write", action="store_true", help="put the recomputed numbers into the pages")
    args = parser.parse_args()
    noisefloor = str((ROOT / args.noisefloor).resolve())
    faults = check_readme(args.write) + [fault for page in PAGES for fault in check(page, args.write)]
    print("\n".join(faults) or f"README.md, {', '.join(PAGES)}: all marked numbers are those of their commands")
    sys.exit(1 if faults and not args.write else 0)
