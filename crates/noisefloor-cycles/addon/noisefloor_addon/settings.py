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
        description="Sample each tile until people stop seeing noise in it, instead of by Cycles' settings",
    )
    viewing: bpy.props.EnumProperty(
        name="Seen on", description="Where the picture will be looked at", items=VIEWING
    )
    people: bpy.props.FloatProperty(
        name="People",
        description="Share of people who see no noise in a tile when it stops",
        default=0.95,
        min=0.5,
        max=0.99,
        subtype="FACTOR",
    )
    min_samples: bpy.props.IntProperty(
        name="Min Samples",
        description="Samples per pixel before a tile can stop; more find more light that is seldom found",
        default=32,
        min=32,
        soft_max=1024,
    )
    max_samples: bpy.props.IntProperty(
        name="Max Samples",
        description="Samples per pixel at which every tile stops",
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
    tile: bpy.props.IntProperty(
        name="Tile",
        description="Edge in pixels of the tiles that stop as a whole",
        default=128,
        min=64,
        max=512,
    )
    write_maps: bpy.props.BoolProperty(
        name="Write Maps and Summary",
        description="Write maps of samples and of the noise that is left, and a summary, beside the frames",
        default=True,
    )


def oracle(settings):
    return noisefloor.Oracle(settings.people)


def people(scene, film=None):
    """Who looks, and where; film: frames per second, or None for a still."""
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
    return found


def params(scene, batch, shown, film=None):
    """How tiles are judged; shown: as display.table() says; film: frames per second, or None for a still. Verdicts come
    after whole batches."""
    settings = scene.noisefloor
    most = max(settings.max_samples // batch, 2) * batch
    return noisefloor.Params(
        tile=settings.tile,
        step=batch,
        min_spp=min(-(-settings.min_samples // batch) * batch, most),
        max_spp=most,
        tone_mapping=shown,
        **people(scene, film),
    )


def still_params(scene, shown):
    """How finished pictures are judged."""
    return noisefloor.Params(tile=64, tone_mapping=shown, **people(scene))
