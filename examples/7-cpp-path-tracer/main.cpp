// A path tracer in C++ with threads of its own. They push tiles into a session, which says when to stop.
//
//     path-tracer [width height [out.pfm]]
#include <noisefloor.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <vector>

struct Vec { float x, y, z; };
static Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
static Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
static Vec operator*(Vec a, Vec b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
static Vec operator*(Vec a, float s) { return {a.x * s, a.y * s, a.z * s}; }
static float dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static Vec unit(Vec a) { return a * (1 / std::sqrt(dot(a, a))); }

// Balls are all there is: a huge one as the floor, two to look at, and one that glows.
struct Ball { Vec centre; float radius; Vec colour, light; };
static const Ball scene[] = {
    {{0, -1000, 0}, 1000, {0.6f, 0.6f, 0.6f}, {0, 0, 0}},
    {{-1, 0.8f, 4}, 0.8f, {0.7f, 0.25f, 0.2f}, {0, 0, 0}},
    {{1, 0.6f, 3.4f}, 0.6f, {0.25f, 0.4f, 0.7f}, {0, 0, 0}},
    {{0.6f, 3.2f, 2.6f}, 0.9f, {0, 0, 0}, {9, 8, 7}},
};
static const Vec sky = {0.15f, 0.18f, 0.22f};

// A stream of random numbers for each pixel and sample (SplitMix64): no sample is ever taken twice.
struct Random {
    std::uint64_t state;
    float next() {
        std::uint64_t z = state += 0x9e3779b97f4a7c15;
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
        z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
        return ((z ^ (z >> 31)) >> 40) * 0x1p-24f;
    }
};

static const Ball *hit(Vec from, Vec direction, float &distance) {
    const Ball *nearest = nullptr;
    distance = 1e30f;
    for (const Ball &ball : scene) {
        Vec to = ball.centre - from;
        float b = dot(to, direction), root = b * b - dot(to, to) + ball.radius * ball.radius;
        if (root < 0) continue;
        float t = b - std::sqrt(root) > 1e-2f ? b - std::sqrt(root) : b + std::sqrt(root);
        if (t > 1e-2f && t < distance) distance = t, nearest = &ball;
    }
    return nearest;
}

static Vec radiance(Vec from, Vec direction, Random &random) {
    Vec sum = {0, 0, 0}, weight = {1, 1, 1};
    for (int bounce = 0; bounce < 5; ++bounce) {
        float t;
        const Ball *ball = hit(from, direction, t);
        if (!ball) return sum + weight * sky;
        sum = sum + weight * ball->light;
        from = from + direction * t;
        Vec normal = unit(from - ball->centre);
        // Cosine-weighted: the normal plus a point on the unit sphere
        float z = 2 * random.next() - 1, phi = 6.2831853f * random.next();
        float r = std::sqrt(std::max(0.f, 1 - z * z));
        direction = unit(normal + Vec{r * std::cos(phi), r * std::sin(phi), z} * 0.999f);
        weight = weight * ball->colour;
    }
    return sum;
}

static void check(NfStatus status) {
    if (status != NF_STATUS_OK) throw std::runtime_error(nf_last_error());
}

// The mean of the new samples of each pixel of a tile, row by row.
static std::vector<float> render(const NfRequest &request, std::size_t width, std::size_t height) {
    NfTile tile = request.tile;
    std::vector<float> mean;
    for (std::size_t y = tile.y; y < tile.y + tile.height; ++y)
        for (std::size_t x = tile.x; x < tile.x + tile.width; ++x) {
            Vec sum = {0, 0, 0};
            for (std::uint64_t n = request.first; n < request.first + request.spp; ++n) {
                Random random = {((y * width + x) << 32 | n) * 0xd1342543de82ef95};
                float u = (x + random.next() - 0.5f * width) / height;
                float v = (y + random.next()) / height - 0.5f;
                sum = sum + radiance({0, 1.2f, -1}, unit({u, -v, 1.1f}), random);
            }
            for (float c : {sum.x, sum.y, sum.z}) mean.push_back(c / request.spp);
        }
    return mean;
}

static void run(std::size_t width, std::size_t height, const char *file) {
    NfParams params;
    check(nf_params_default(&params));
    params.tile = 64;
    params.max_spp = 4000;
    NfOracle *oracle;
    check(nf_oracle_bundled(0.95f, &oracle));
    std::unique_ptr<NfOracle, NfStatus (*)(NfOracle *)> oracle_owner(oracle, nf_oracle_free);
    NfSession *session;
    check(nf_session_new(width, height, oracle, &params, &session));
    std::unique_ptr<NfSession, NfStatus (*)(NfSession *)> session_owner(session, nf_session_free);

    std::vector<NfRequest> requests(nf_session_tile_count(session));
    for (;;) {
        std::size_t count, done;
        check(nf_session_requests(session, requests.data(), requests.size(), &count));
        if (count == 0) break;
        // Each thread takes the next tile, renders it, and pushes it.
        std::atomic<std::size_t> next = 0;
        std::atomic<bool> failed = false;
        auto work = [&] {
            for (std::size_t i; (i = next++) < count && !failed;) try {
                std::vector<float> mean = render(requests[i], width, height);
                check(nf_session_push(session, requests[i].tile.index, requests[i].spp, mean.data(), mean.size()));
            } catch (const std::exception &error) {
                std::fprintf(stderr, "%s\n", error.what());
                failed = true;
            }
        };
        std::vector<std::thread> threads;
        unsigned cores = std::max(2u, std::thread::hardware_concurrency());
        for (unsigned i = 0; i < cores; ++i) threads.emplace_back(work);
        for (std::thread &thread : threads) thread.join();
        if (failed) throw std::runtime_error("a tile could not be pushed");
        check(nf_session_judge(session, &done));
    }

    // What is certainly wrong with samples was an error above; what is likely wrong is said here.
    NfSampleCounts counts;
    check(nf_session_sample_counts(session, &counts));
    for (std::size_t i = 0; i < counts.warnings; ++i) {
        char text[400];
        check(nf_session_warning(session, i, text, sizeof text));
        std::fprintf(stderr, "warning: %s\n", text);
    }

    double samples = 0;
    std::vector<NfTileState> states(requests.size());
    check(nf_session_states(session, states.data(), states.size()));
    for (std::size_t i = 0; i < states.size(); ++i) {
        NfTile tile;
        check(nf_session_tile(session, i, &tile));
        const char *why = states[i].reason == NF_REASON_CONVERGED ? "converged" : "at the limit";
        auto spp = static_cast<unsigned long long>(states[i].spp);
        std::printf("tile %2zu at (%3zu, %3zu): %s with %4llu samples per pixel, P = %.3f\n", i, tile.x,
                    tile.y, why, spp, static_cast<double>(states[i].probability));
        samples += double(states[i].spp) * tile.width * tile.height;
    }
    std::printf("%.0f samples per pixel on average\n", samples / (width * height));

    std::vector<float> image(3 * width * height);
    check(nf_session_image(session, image.data(), image.size()));
    if (!file) return;
    std::FILE *out = std::fopen(file, "wb");
    if (!out) throw std::runtime_error("cannot write the picture");
    std::fprintf(out, "PF\n%zu %zu\n-1\n", width, height);
    // Rows from below, as PFM has them
    for (std::size_t y = height; y-- > 0;) std::fwrite(&image[3 * width * y], sizeof(float), 3 * width, out);
    std::fclose(out);
}

int main(int argc, char **argv) try {
    bool sized = argc >= 3;
    run(sized ? std::strtoul(argv[1], nullptr, 10) : 320, sized ? std::strtoul(argv[2], nullptr, 10) : 256,
        argc >= 4 ? argv[3] : nullptr);
} catch (const std::exception &error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 1;
}
