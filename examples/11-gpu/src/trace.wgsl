// A progressive path tracer: a room with a lamp and two balls. Each call adds new samples to the sums of a pass.

struct Pass {
    width: u32,
    height: u32,
    // Samples of this call, and the number of the first, over all passes
    samples: u32,
    first: u32,
    // Nothing but one ball of albedo 1/2 under a white sky: the answer is known
    furnace: u32,
}

struct Hit {
    at: f32,
    normal: vec3f,
    albedo: vec3f,
    light: vec3f,
}

@group(0) @binding(0) var<uniform> pass_of: Pass;
@group(0) @binding(1) var<storage, read_write> sums: array<vec4f>;

// PCG (O'Neill 2014)
var<private> state: u32;

fn draw() -> f32 {
    state = state * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return f32(((word >> 22u) ^ word) >> 8u) / 16777216.0;
}

// Its streams are far apart where their seeds are mixed
fn mixed(seed: u32) -> u32 {
    var x = seed;
    x = (x ^ (x >> 16u)) * 0x7feb352du;
    x = (x ^ (x >> 15u)) * 0x846ca68bu;
    return x ^ (x >> 16u);
}

fn ball(nearest: ptr<function, Hit>, origin: vec3f, way: vec3f, centre: vec3f, radius: f32, albedo: vec3f) {
    let apart = origin - centre;
    let b = dot(apart, way);
    let root = b * b - dot(apart, apart) + radius * radius;
    let at = -b - sqrt(max(root, 0.0));
    if root > 0.0 && at > 1e-3 && at < (*nearest).at {
        *nearest = Hit(at, normalize(apart + at * way), albedo, vec3f(0.0));
    }
}

fn wall(nearest: ptr<function, Hit>, origin: vec3f, way: vec3f, normal: vec3f, distance: f32, albedo: vec3f) {
    let at = -(dot(origin, normal) + distance) / dot(way, normal);
    if dot(way, normal) < 0.0 && at > 1e-3 && at < (*nearest).at {
        let place = origin + at * way;
        let lamp = normal.y < 0.0 && abs(place.x) < 0.5 && abs(place.z) < 0.5;
        *nearest = Hit(at, normal, albedo, select(vec3f(0.0), vec3f(6.0, 5.5, 4.5), lamp));
    }
}

fn look(origin: vec3f, way: vec3f) -> Hit {
    var nearest = Hit(1e9, vec3f(0.0), vec3f(0.0), vec3f(1.0));
    if pass_of.furnace != 0u {
        ball(&nearest, origin, way, vec3f(0.0), 0.8, vec3f(0.5));
        return nearest;
    }
    let white = vec3f(0.7);
    wall(&nearest, origin, way, vec3f(0.0, 1.0, 0.0), 1.0, white);
    wall(&nearest, origin, way, vec3f(0.0, -1.0, 0.0), 1.0, white);
    wall(&nearest, origin, way, vec3f(0.0, 0.0, 1.0), 1.0, white);
    wall(&nearest, origin, way, vec3f(0.0, 0.0, -1.0), 3.5, white);
    wall(&nearest, origin, way, vec3f(1.0, 0.0, 0.0), 1.5, vec3f(0.6, 0.1, 0.1));
    wall(&nearest, origin, way, vec3f(-1.0, 0.0, 0.0), 1.5, vec3f(0.1, 0.4, 0.1));
    ball(&nearest, origin, way, vec3f(-0.6, -0.55, -0.2), 0.45, vec3f(0.8));
    ball(&nearest, origin, way, vec3f(0.6, -0.6, 0.3), 0.4, vec3f(0.8, 0.6, 0.2));
    return nearest;
}

fn radiance(pixel: vec2f) -> vec3f {
    let size = vec2f(f32(pass_of.width), f32(pass_of.height));
    let across = (2.0 * pixel - size) / size.y * vec2f(1.0, -1.0);
    var origin = vec3f(0.0, 0.0, 3.2);
    var way = normalize(vec3f(across, -2.1));
    var carried = vec3f(1.0);
    var sum = vec3f(0.0);
    for (var bounce = 0; bounce < 12; bounce++) {
        let hit = look(origin, way);
        sum += carried * hit.light;
        if any(hit.light > vec3f(0.0)) {
            break;
        }
        carried *= hit.albedo;
        origin += hit.at * way + 1e-4 * hit.normal;
        // A diffuse bounce: the normal, and a point of the unit sphere around its end
        let z = 1.0 - 2.0 * draw();
        let turn = 6.2831853 * draw();
        let r = sqrt(max(0.0, 1.0 - z * z));
        way = normalize(hit.normal + 0.999 * vec3f(r * cos(turn), r * sin(turn), z));
    }
    return sum;
}

@compute @workgroup_size(8, 8)
fn trace(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= pass_of.width || id.y >= pass_of.height {
        return;
    }
    let pixel = id.y * pass_of.width + id.x;
    var sum = vec3f(0.0);
    for (var i = 0u; i < pass_of.samples; i++) {
        state = mixed(pixel + mixed(pass_of.first + i));
        let place = vec2f(id.xy) + vec2f(draw(), draw());
        sum += radiance(place);
    }
    sums[pixel] += vec4f(sum, 0.0);
}
