"""Scenes with a camera that moves, for film.py: six small ones, two moves each, as Mitsuba 3 scenes of one frame."""
import math

MOVES = ("along", "around")


def rgb(name, value):
    return f'<rgb name="{name}" value="{value}"/>'


def shape(kind, transform, surface, extra=""):
    return f'<shape type="{kind}"><transform name="to_world">{transform}</transform>{surface}{extra}</shape>'


def diffuse(colour):
    return f'<bsdf type="twosided"><bsdf type="diffuse">{rgb("reflectance", colour)}</bsdf></bsdf>'


def box(centre, half, surface):
    scale, move = (f'<{tag} x="{x}" y="{y}" z="{z}"/>' for tag, (x, y, z) in (("scale", half), ("translate", centre)))
    return shape("cube", scale + move, surface)


def ball(centre, radius, surface, extra=""):
    x, y, z = centre
    return shape("sphere", f'<scale value="{radius}"/><translate x="{x}" y="{y}" z="{z}"/>', surface, extra)


def lamp(centre, half, radiance):
    """A rectangle that shines downwards."""
    (x, y, z), (w, d) = centre, half
    place = f'<scale x="{w}" y="{d}"/><rotate x="1" angle="90"/><translate x="{x}" y="{y}" z="{z}"/>'
    return shape("rectangle", place, diffuse("0.5"), f'<emitter type="area">{rgb("radiance", radiance)}</emitter>')


WHITE, RED, GREEN, GREY = map(diffuse, ("0.73", "0.6, 0.1, 0.08", "0.15, 0.45, 0.12", "0.4"))
METAL = '<bsdf type="roughconductor"><float name="alpha" value="0.2"/><string name="material" value="Al"/></bsdf>'
GLASS = '<bsdf type="dielectric"/>'
BLUE = rgb("diffuse_reflectance", "0.2, 0.3, 0.6")
PLASTIC = f'<bsdf type="roughplastic"><float name="alpha" value="0.15"/>{BLUE}</bsdf>'


def room(width, height, depth, walls=(RED, GREEN)):
    """Six slabs around the origin of the floor."""
    t, (left, right) = 0.05, walls
    return "".join([
        box((0, -t, 0), (width, t, depth), WHITE), box((0, height + t, 0), (width, t, depth), WHITE),
        box((-width - t, height / 2, 0), (t, height / 2, depth), left),
        box((width + t, height / 2, 0), (t, height / 2, depth), right),
        box((0, height / 2, -depth - t), (width, height / 2, t), GREY),
        box((0, height / 2, depth + t), (width, height / 2, t), GREY)])


def line(a, b):
    return lambda t: tuple(p + t * (q - p) for p, q in zip(a, b))


def arc(centre, radius, height, begin, end):
    def at(t):
        angle = math.radians(begin + t * (end - begin))
        return centre[0] + radius * math.sin(angle), height, centre[2] + radius * math.cos(angle)
    return at


still = lambda point: lambda t: point

columns = lambda xs, zs, half: "".join(box((x, half[1], z), half, WHITE) for x in xs for z in zs)
emitter = lambda kind, inside: f'<emitter type="{kind}">{inside}</emitter>'

# What there is, and for each move where the camera is and what it looks at
SCENES = {
    "blocks": (
        room(1, 2, 2) + lamp((0, 1.98, -0.8), (0.35, 0.35), "14, 12, 9")
        + box((-0.35, 0.6, -1.1), (0.3, 0.6, 0.3), WHITE) + box((0.4, 0.3, -0.6), (0.3, 0.3, 0.3), PLASTIC),
        (line((0, 1, 1.9), (0.1, 0.9, 0.6)), still((0, 0.8, -1))),
        (arc((0, 1, -0.8), 2.2, 1.1, -20, 20), still((0, 0.8, -0.8)))),
    "bulb": (
        room(2, 2.4, 3, (WHITE, PLASTIC))
        + ball((0.6, 1.7, -1.2), 0.08, GREY, emitter("area", rgb("radiance", "90, 75, 55")))
        + ball((-0.7, 0.5, -1.6), 0.5, METAL) + box((0.9, 0.4, -0.8), (0.3, 0.4, 0.3), RED),
        (line((-1.4, 1.2, 2.6), (1.2, 1.4, 1.2)), still((0, 0.9, -1.5))),
        (still((0, 1.3, 2)), line((-1.8, 0.8, -1), (1.8, 1.2, -1)))),
    "glass": (
        room(1.5, 2, 2, (GREEN, WHITE)) + lamp((0.2, 1.98, -0.5), (1.1, 1.1), "5, 4.6, 4")
        + ball((-0.4, 0.45, -0.7), 0.45, GLASS) + ball((0.55, 0.35, -1.1), 0.35, PLASTIC),
        (line((0.9, 1.3, 1.8), (-0.9, 0.7, 1)), still((0, 0.5, -0.8))),
        (arc((0, 0.5, -0.8), 2.3, 1, 15, -20), still((0, 0.5, -0.8)))),
    "yard": (
        box((0, -0.1, 0), (12, 0.1, 12), GREY) + columns((-4, -2, 0, 2, 4), (-2,), (0.2, 1.2, 0.2))
        + box((0, 2.6, -2), (4.6, 0.2, 0.8), WHITE) + box((0, 1.6, -4), (5, 1.6, 0.2), RED)
        + ball((1, 0.6, 0), 0.6, PLASTIC) + emitter("constant", rgb("radiance", "0.5, 0.7, 1"))
        + emitter("directional", '<vector name="direction" x="0.5" y="-1" z="-0.6"/>' + rgb("irradiance", "4, 3.7, 3")),
        (line((-4, 1.5, 2.5), (4, 1.5, -0.5)), line((-2, 1, -3), (2, 1, -3))),
        (still((0, 1.4, 1.5)), line((-5, 0.8, -3), (5, 1.6, -3)))),
    "hall": (
        room(1.5, 2.5, 8) + "".join(lamp((0, 2.48, z), (0.3, 0.3), "10, 9, 8") for z in (-6, -2, 2, 6))
        + columns((-0.9, 0.9), (-6, -4, -2, 0, 2, 4), (0.12, 1.25, 0.12)) + box((0.3, 0.4, -3), (0.3, 0.4, 0.3), PLASTIC),
        (line((0, 1.4, 7.5), (0, 1.4, 1)), line((0, 1.2, 0), (0, 1.2, -7))),
        (still((0, 1.4, 0)), line((-2, 1, -7), (3, 1.2, -0.5)))),
    "screen": (
        # Lit from behind a wall that is half as high as the room
        room(2, 2.4, 3, (WHITE, GREY)) + box((0.4, 0.7, -1.4), (1.1, 0.7, 0.06), RED)
        + lamp((0.6, 2.38, -2.1), (0.8, 0.5), "16, 15, 13")
        + ball((-0.9, 0.5, -0.8), 0.5, PLASTIC) + box((0.8, 0.3, 0), (0.4, 0.3, 0.3), WHITE),
        (line((0, 1.3, 2.8), (-0.9, 1.2, 1)), still((-0.6, 0.9, -1.6))),
        (still((0.2, 1.3, 2.2)), line((-1.8, 0.8, -1), (1.6, 0.8, -1)))),
}


def moving_scene(scene, move, way):
    """The scene at a share of the way, 0 to 1."""
    things, *moves = SCENES[scene]
    origin, target = (", ".join(f"{x:.6f}" for x in place(way)) for place in moves[MOVES.index(move)])
    return (f'<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="8"/></integrator>'
            f'<sensor type="perspective"><float name="fov" value="50"/><transform name="to_world">'
            f'<lookat origin="{origin}" target="{target}" up="0, 1, 0"/></transform></sensor>{things}</scene>\n')


def write_frames(folder, scene, move, frames):
    """Their files, and the pattern of their names."""
    folder.mkdir(parents=True, exist_ok=True)
    for frame in range(1, frames + 1):
        text = moving_scene(scene, move, (frame - 1) / (frames - 1))
        (folder / f"{scene}-{move}.{frame:04}.xml").write_text(text)
    return str(folder / f"{scene}-{move}.{{frame:04}}.xml")
