"""What the panel sets, kept in the scene and saved with the file."""

import bpy
import noisefloor

VIEWING = [
    ("desk", "Desk", "24 inches, Full HD, seen from 60 cm, in an office"),
    ("laptop", "Laptop", "A laptop"),
    ("tv", "TV", "A television in a living room"),
    ("phone", "Phone", "A phone"),
    ("cinema", "Cinema", "A cinema"),
    ("mine", "My Eyes", "By your eyes and on your display, as `noisefloor calibrate` has measured them"),
]


class Settings(bpy.types.PropertyGroup):
    use: bpy.props.BoolProperty(
        name="Render until nobody sees noise",
        description="Sample by Cycles' noise threshold, which falls where people still see noise, instead of by Cycles' settings",
    )
    viewing: bpy.props.EnumProperty(
        name="Seen on", description="Where the picture will be looked at", items=VIEWING
    )
    people: bpy.props.FloatProperty(
        name="People",
        description="Share of people who see no noise, if the picture is not denoised",
        default=0.95,
        min=0.5,
        max=0.99,
        subtype="FACTOR",
    )
    lost: bpy.props.FloatProperty(
        name="JOD Lost",
        description="What a denoised picture may lose in its worst place, in just-objectionable differences, by a model of "
        "vision. Of 100 people who are shown that place beside the perfect one, 58 prefer the perfect one at 0.3, and 53 "
        "at 0.1, where 50 would by guessing; 75 do at 1",
        default=0.3,
        min=0.05,
        max=2.0,
    )
    max_samples: bpy.props.IntProperty(
        name="Max Samples",
        description="Samples per pixel at which every pixel stops",
        default=4096,
        min=32,
        soft_max=16384,
    )
    time_limit: bpy.props.FloatProperty(
        name="Time Limit",
        description="Seconds after which a frame stops; 0 is no limit",
        min=0,
        unit="TIME_ABSOLUTE",
    )
    frames: bpy.props.EnumProperty(
        name="Frames",
        description="Which frames Find Noise Threshold looks at",
        items=[
            ("current", "This Frame", "The frame that is shown"),
            ("markers", "Marked Frames", "Frames with a marker in the timeline: one threshold for all, by the hardest"),
        ],
    )
    write_maps: bpy.props.BoolProperty(
        name="Write Maps and Summary",
        description="Write maps of samples and of the noise that is left, and a summary, beside the frames",
        default=True,
    )


def params(scene, shown, film=None):
    """How pictures are judged: who looks, and where; shown: as display.table() says; film: frames per second, or None for a
    still."""
    settings, found = scene.noisefloor, {"viewing": scene.noisefloor.viewing}
    if settings.viewing == "mine":
        eyes = noisefloor.eyes()
        if eyes is None:
            raise ValueError(
                "your eyes are unknown: run `noisefloor calibrate`, or choose where the picture is seen"
            )
        found = {"viewing": eyes.viewing, "audience": eyes.audience}
    if film:
        found["viewing"] = f"{found['viewing']},fps={film:.6g}"
    return noisefloor.Params(tile=64, tone_mapping=shown, **found)
