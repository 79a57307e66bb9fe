/* Rays a second of Embree, one ray at a time on one core; and the rays, for our hierarchy to trace.

     gcc -O3 -march=native embree.c -lembree3 -lm -o embree
     ./embree FOLDER/NAME

   Reads NAME.triangles and NAME.camera (scene.py) and writes NAME.closest and NAME.shadow: a million rays of diffuse
   paths of up to five bounces, and a million from one of their ends to that of another. A ray is eight floats: origin,
   direction, length, and what Embree says of it: the distance found, or 1 if something is in between. */

#include <embree3/rtcore.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

enum { RAYS = 1000000, BOUNCES = 5, PASSES = 10, PART = 5000 };

typedef struct { float o[3], d[3], length, found; } Ray;

static uint64_t state = 88172645463325252ull;
static float uniform(void) {
    state ^= state << 13, state ^= state >> 7, state ^= state << 17;
    return (float)(state >> 40) / 16777216.0f;
}

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

static void *load(const char *stem, const char *end, size_t *bytes) {
    char path[4096];
    snprintf(path, sizeof path, "%s.%s", stem, end);
    FILE *file = fopen(path, "rb");
    if (!file) { perror(path); exit(1); }
    fseek(file, 0, SEEK_END);
    *bytes = ftell(file);
    rewind(file);
    void *all = malloc(*bytes);
    if (fread(all, 1, *bytes, file) != *bytes) { perror(path); exit(1); }
    fclose(file);
    return all;
}

static void save(const char *stem, const char *end, const Ray *rays) {
    char path[4096];
    snprintf(path, sizeof path, "%s.%s", stem, end);
    FILE *file = fopen(path, "wb");
    if (!file || fwrite(rays, sizeof(Ray), RAYS, file) != RAYS || fclose(file)) { perror(path); exit(1); }
}

static void set(struct RTCRay *to, const Ray *ray) {
    memset(to, 0, sizeof *to);
    to->org_x = ray->o[0], to->org_y = ray->o[1], to->org_z = ray->o[2];
    to->dir_x = ray->d[0], to->dir_y = ray->d[1], to->dir_z = ray->d[2];
    to->tfar = ray->length, to->mask = -1;
}

static struct RTCRayHit closest(RTCScene scene, const Ray *ray) {
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    struct RTCRayHit hit;
    set(&hit.ray, ray);
    hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(scene, &context, &hit);
    return hit;
}

static int blocked(RTCScene scene, const Ray *ray) {
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    struct RTCRay shadow;
    set(&shadow, ray);
    rtcOccluded1(scene, &context, &shadow);
    return shadow.tfar < 0;
}

/* A direction around n, distributed as its cosine. */
static void scatter(const float n[3], float d[3]) {
    float z = 2 * uniform() - 1, phi = 6.2831853f * uniform(), r = sqrtf(1 - z * z), length = 0;
    float sphere[3] = {r * cosf(phi), r * sinf(phi), z};
    for (int i = 0; i < 3; i++) d[i] = n[i] * 1.0001f + sphere[i], length += d[i] * d[i];
    for (int i = 0; i < 3; i++) d[i] /= sqrtf(length);
}

static void make_rays(RTCScene scene, const float *camera, size_t cameras, float offset, Ray *rays, Ray *shadows) {
    size_t count = 0, other = 0;
    float(*ends)[3] = malloc(RAYS * sizeof *ends);
    for (size_t c = 0; count < RAYS; c = (c + 1) % cameras) {
        Ray ray = {.length = INFINITY};
        memcpy(ray.o, camera + 6 * c, 12), memcpy(ray.d, camera + 6 * c + 3, 12);
        for (int bounce = 0; bounce <= BOUNCES && count < RAYS; bounce++) {
            struct RTCRayHit hit = closest(scene, &ray);
            ray.found = hit.ray.tfar;
            if (bounce > 0) rays[count++] = ray;
            if (hit.hit.geomID == RTC_INVALID_GEOMETRY_ID) break;
            float n[3] = {hit.hit.Ng_x, hit.hit.Ng_y, hit.hit.Ng_z}, length = 0, cos = 0;
            for (int i = 0; i < 3; i++) length += n[i] * n[i], cos += n[i] * ray.d[i];
            for (int i = 0; i < 3; i++) {
                n[i] /= cos > 0 ? -sqrtf(length) : sqrtf(length);
                ray.o[i] += ray.found * ray.d[i] + offset * n[i];
            }
            if (other < RAYS) {
                memcpy(ends[other], ray.o, 12);
                Ray shadow;
                memcpy(shadow.o, ray.o, 12);
                const float *to = ends[(size_t)(uniform() * other)];
                float reach = 0;
                for (int i = 0; i < 3; i++) shadow.d[i] = to[i] - ray.o[i], reach += shadow.d[i] * shadow.d[i];
                if (reach > 0) {
                    for (int i = 0; i < 3; i++) shadow.d[i] /= sqrtf(reach);
                    shadow.length = 0.999f * sqrtf(reach);
                    shadow.found = blocked(scene, &shadow);
                    shadows[other] = shadow;
                }
                other += other == 0 || reach > 0;
            }
            scatter(n, ray.d);
        }
    }
    /* Paths that leave early have more ends than bounces, others fewer: fill up with what is there */
    for (size_t made = other; other < RAYS; other++) shadows[other] = shadows[1 + other % (made - 1)];
    shadows[0] = shadows[1];
    free(ends);
}

int main(int argc, char **argv) {
    if (argc != 2) return fprintf(stderr, "usage: embree FOLDER/NAME\n"), 2;
    size_t bytes, camera_bytes;
    float *corners = load(argv[1], "triangles", &bytes), *camera = load(argv[1], "camera", &camera_bytes);
    size_t triangles = bytes / 36;
    RTCDevice device = rtcNewDevice("threads=1");
    RTCScene scene = rtcNewScene(device);
    RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    float *vertices = rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, 3 * triangles);
    memcpy(vertices, corners, bytes);
    unsigned *index = rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, triangles);
    for (size_t i = 0; i < 3 * triangles; i++) index[i] = i;
    rtcCommitGeometry(mesh);
    rtcAttachGeometry(scene, mesh);
    double start = now();
    rtcCommitScene(scene);
    double build = now() - start;

    struct RTCBounds box;
    rtcGetSceneBounds(scene, &box);
    float x = box.upper_x - box.lower_x, y = box.upper_y - box.lower_y, z = box.upper_z - box.lower_z;
    Ray *rays = malloc(RAYS * sizeof *rays), *shadows = malloc(RAYS * sizeof *shadows);
    make_rays(scene, camera, camera_bytes / 24, 1e-5f * sqrtf(x * x + y * y + z * z), rays, shadows);
    save(argv[1], "closest", rays), save(argv[1], "shadow", shadows);

    /* The shortest of some passes over each part: other processes on the machine spare some */
    double seconds[2] = {0, 0}, sum = 0;
    static double best[2][RAYS / PART];
    for (int pass = 0; pass < PASSES; pass++)
        for (int shadow = 0; shadow < 2; shadow++)
            for (size_t part = 0; part < RAYS / PART; part++) {
                start = now();
                for (size_t i = part * PART; i < (part + 1) * PART; i++)
                    sum += shadow ? blocked(scene, shadows + i) : closest(scene, rays + i).ray.tfar < INFINITY;
                double took = now() - start;
                if (pass == 0 || took < best[shadow][part]) best[shadow][part] = took;
            }
    for (int shadow = 0; shadow < 2; shadow++)
        for (size_t part = 0; part < RAYS / PART; part++) seconds[shadow] += best[shadow][part];
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    printf("%s: %zu triangles, built in %.2f s, %.2f and %.2f million rays a second, peak %.0f MB (%.0f %% hit)\n",
           argv[1], triangles, build, RAYS / seconds[0] / 1e6, RAYS / seconds[1] / 1e6, usage.ru_maxrss / 1024.0,
           100 * sum / PASSES / RAYS / 2);
    return 0;
}
