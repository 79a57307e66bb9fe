"""Records what ColorVideoVDP says of the pairs of pictures and the films that tests/cvvdp.json lists, into that file.

    pip install cvvdp==0.5.7
    python crates/noisefloor-vision/tests/record_cvvdp.py

Those that were recorded with the same versions are kept; to add one, write it into the file without results, as
`picture` and `metric` take it. The pictures are integers out of integers, so that both languages see the same ones.
"""

import json
import math
import platform
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch
from pycvvdp import cvvdp
from pycvvdp.display_model import vvdp_display_geometry, vvdp_display_photo_eotf
from pycvvdp.video_source import video_source_array

U = np.uint32
# What is recorded of a pair, and of a film: a still view whose noise of `amount` is new in each frame, and that of `standing` is not
PAIR, FILM = {"jod", "mean", "rms", "sample"}, {"video", "by_frame", "map_rms"}


def hashed(x, y, channel, seed):
    """32 random bits of a place."""
    with np.errstate(over="ignore"):
        of_pair = (channel * 0xC2B2AE3D ^ seed * 0x27D4EB2F) & 0xFFFFFFFF
        h = x * U(0x9E3779B1) ^ y * U(0x85EBCA77) ^ U(of_pair)
        for shift, factor in ((15, 0x2C1B3C6D), (12, 0x297A2D39)):
            h = (h ^ h >> U(shift)) * U(factor)
        return h ^ h >> U(15)


def pattern(case, x, y):
    """0 to 255 in each pixel."""
    width, height = case["width"], case["height"]
    x, y = x.astype(np.int64), y.astype(np.int64)
    match case["pattern"]:
        case "flat":
            return np.full_like(x, 128)
        case "ramp":
            return (255 * (x + y)) // (width + height)
        case "bars":
            return ((x // 5 + y // 9) % 2) * 255
        case "disc":
            distance = (2 * x - width) ** 2 * height * height + (2 * y - height) ** 2 * width * width
            return np.where(2 * distance < (width * height) ** 2, 230, 40)
        case "bowl":
            distance = (2 * x - width) ** 2 * height * height + (2 * y - height) ** 2 * width * width
            return np.minimum(255, 255 * distance // (2 * (width * height) ** 2))
        case "mosaic":
            return (hashed((x // 3).astype(U), (y // 3).astype(U), 7, 1) >> U(24)).astype(np.int64)


def picture(case, noises):
    """Code values, rows × columns × 3, with these noises: of each, its amounts and its seed."""
    y, x = np.mgrid[0 : case["height"], 0 : case["width"]].astype(U)
    shape = pattern(case, x, y)
    channels = []
    for channel in range(3):
        low, high = case["low"][channel], case["high"][channel]
        code = low + (high - low) * shape // 255
        for amounts, seed in noises:
            amount = amounts[channel]
            of = 0 if case["grey"] else channel
            h = hashed(x // U(case["grain"]), y // U(case["grain"]), of, seed)
            both_halves = (h & U(0xFFFF)).astype(np.int64) + (h >> U(16))
            code = code + both_halves * (2 * amount + 1) // 131071 - amount
        value = np.clip(code, 0, 255).astype(np.float32) / np.float32(255)
        channels.append(value * np.float32(case["scale"]))
    return np.stack(channels, axis=-1)


class Recorder(cvvdp):
    """Keeps the map before it is rounded to half precision."""

    def process_block_of_frames(self, *arguments):
        quality, self.raw = super().process_block_of_frames(*arguments)
        return quality, self.raw


# CIE 1931 x and y of red, green and blue (ITU-R BT.709 and BT.2020), and of whites
GAMUTS = {
    "rec709": ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06)),
    "rec2020": ((0.708, 0.292), (0.170, 0.797), (0.131, 0.046)),
}
WHITES = {"d50": (0.3457, 0.3585), "d93": (0.2831, 0.2971)}
# Spaces that the package has
OWN = {"rec709": "sRGB", "rec2020": "BT.2020-linear", "p3": "Display P3 Apple"}


def space(primaries, white):
    """An entry of color_spaces.json: linear RGB to XYZ, such that RGB of 1 is white with a Y of 1."""
    numbers = lambda text: [float(number) for number in text.split(":")]
    corners = GAMUTS.get(primaries)
    corners = np.reshape(numbers(primaries), (3, 2)) if corners is None else np.array(corners)
    x, y = WHITES[white] if white in WHITES else numbers(white)
    columns = np.column_stack([corners, 1 - corners.sum(axis=1)]).T
    matrix = columns * np.linalg.solve(columns, np.array([x, y, 1 - x - y]) / y)
    return {"EOTF": "sRGB", **dict(zip(("RGB2X", "RGB2Y", "RGB2Z"), matrix.tolist()))}


def photometry(of):
    """The display of these numbers; a colour space that the package lacks goes into a file of its own."""
    primaries, white = of.get("primaries", "rec709"), of.get("white", "d65")
    settings = dict(
        contrast=float(of["contrast"]),
        EOTF={"srgb": "sRGB", "hlg": "HLG"}.get(of["eotf"], of["eotf"].removeprefix("gamma")),
        E_ambient=float(of["ambient"]),
        k_refl=float(of["reflectivity"]),
    )
    if white == "d65" and primaries in OWN:
        return vvdp_display_photo_eotf(float(of["peak"]), source_colorspace=OWN[primaries], **settings)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "color_spaces.json"
        path.write_text(json.dumps({"own": space(primaries, white)}))
        own = dict(source_colorspace="own", config_paths=[str(path)])
        return vvdp_display_photo_eotf(float(of["peak"]), **own, **settings)


def metric(viewing):
    """The metric for a display of cvvdp, or for numbers."""
    if "=" not in viewing:
        return Recorder(display_name=viewing, heatmap="raw", device=torch.device("cpu"), quiet=True)
    of = dict(part.split("=") for part in viewing.split(","))
    geometry = vvdp_display_geometry((1920, 1080), ppd=float(of["ppd"]))
    display = dict(display_photometry=photometry(of), display_geometry=geometry)
    return Recorder(**display, heatmap="raw", device=torch.device("cpu"), quiet=True)


def record(case):
    """The case with its JOD, and of the map its mean, root mean square and an 8×8 sample, in JODs lost."""
    of = metric(case["viewing"])
    noise = (case["amount"], case["seed"])
    test, reference = (torch.tensor(picture(case, noises)) for noises in ([noise], []))
    jod, _ = of.predict(test, reference, dim_order="HWC")
    lost = 10 * of.raw[0, 0, 0].double().numpy()
    places = [[(2 * i + 1) * n // 16 for i in range(8)] for n in lost.shape]
    sample = lost[np.ix_(*places)].flatten()
    rounded = lambda value: float(f"{value:.6g}")
    return {
        **case,
        "jod": round(float(jod), 5),
        "mean": rounded(lost.mean()),
        "rms": rounded(np.sqrt((lost**2).mean())),
        "sample": [rounded(value) for value in sample],
    }


# Lengths of the filters that differences are averaged over, after one
LENGTHS = 4


def film(case):
    """The case with JODs lost by the film in video mode, and by its first frame filtered for itself: the noise times
    the norm of each channel's filter."""
    of = metric(case["viewing"])
    reference = picture(case, [])
    noise = (case["standing"], case["seed"])
    lead = int(math.ceil(0.25 * case["rate"] / 2) * 2)
    standing = picture(case, [noise])
    frames = [picture(case, [noise, (case["amount"], case["seed"] + 1 + i)]) for i in range((1 + LENGTHS) * lead)]
    references = np.broadcast_to(reference, (len(frames), *reference.shape)).copy()
    _, stats = of.predict(np.stack(frames), references, dim_order="FHWC", frames_per_second=case["rate"])

    def lost(channels):
        """As `do_pooling_and_jods` of a film, of whatever frames."""
        weights = of.get_ch_weights(4).repeat(1, 1, 1, channels.shape[-1])
        weights[:, :, 0, -1] *= of.baseband_weight[:4]
        bands = of.lp_norm(channels * weights, of.beta_sch, dim=3, normalize=False)
        across = of.lp_norm(bands, of.beta_tch, dim=1, normalize=False)
        return 10 - float(of.met2jod(of.lp_norm(across, of.beta_t, dim=2, normalize=True).reshape(1)))

    def opponent(code):
        code = np.ascontiguousarray(code)
        source = video_source_array(code, code, 0, dim_order="HWC", display_photometry=of.display_photometry)
        return source.get_test_frame(0, device=of.device, colorspace="DKLd65")[:, :, 0]

    gains = [float(taps.square().sum().sqrt()) for taps in of.F]
    test, same, truth = map(opponent, (frames[0], standing, reference))
    channels = torch.zeros((1, 8, 1, *test.shape[-2:]))
    for channel in range(3):
        channels[:, 2 * channel, 0] = same[:, channel] + gains[channel] * (test - same)[:, channel]
        channels[:, 2 * channel + 1, 0] = truth[:, channel]
    channels[:, 6, 0] = gains[3] * (test - same)[:, 0]
    quality, of_map = of.process_block_of_frames(channels, (*test.shape[-2:], 2), 2, of.lpyr, False)
    # A map of a film counts channels as that of a still does
    return {
        **case,
        "video": round(lost(torch.as_tensor(stats["Q_per_ch"])[:, :, lead:]), 5),
        "by_frame": round(lost(quality), 5),
        "map_rms": float(f"{(100 * of_map.double().square().mean()).sqrt().item():.6g}"),
    }


def main():
    torch.set_num_threads(1)
    path = Path(__file__).with_name("cvvdp.json")
    head = {"python": platform.python_version()} | {name: version(name) for name in ("cvvdp", "torch", "torchvision", "numpy")}
    before = json.loads(path.read_text())
    parts = {"versions": json.dumps(head)}
    for name, results, measure in [("pairs", PAIR, record), ("films", FILM, film)]:
        lines = []
        for case in before[name]:
            if before["versions"] != head or not results <= case.keys():
                case = measure({key: value for key, value in case.items() if key not in results})
            lines.append(json.dumps(case, separators=(",", ":")))
        parts[name] = "[\n" + ",\n".join(lines) + "\n]"
    path.write_text('{{"versions": {versions}, "pairs": {pairs},\n"films": {films}}}\n'.format(**parts))


if __name__ == "__main__":
    main()
