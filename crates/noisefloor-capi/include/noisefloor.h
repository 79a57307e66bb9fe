// noisefloor tells a progressive renderer, tile by tile, when people stop seeing noise.
//
// An oracle (a trained model and a share of people) judges the tiles of a session. The renderer asks the session
// which tiles are open, pushes the mean of new samples of each, lets the session judge, and ends when no tile
// is open.
//
// Errors. Every function that can fail returns an NfStatus, and writes its results through pointers only if
// that is NF_STATUS_OK. nf_last_error says what was wrong. No function throws or unwinds into the caller.
// A function of yours that this library calls must not throw or jump out either: an exception that leaves it ends the
// program (std::terminate); catch it there, and return what is not 0. An
// error inside the library is NF_STATUS_INTERNAL, also reported on standard error; the session it happened in
// answers NF_STATUS_INTERNAL from then on and can only be freed. A picture that there is no memory for is
// NF_STATUS_MEMORY; where the system has not even a few megabytes left, the process ends.
//
// Handles are numbers in the shape of pointers, each given once: one that was freed, or is of another kind, is
// NF_STATUS_HANDLE. What is freed while another thread uses it ends when that call returns.
//
// Threads. Any thread may call any function on any object at any time. Calls on one session take turns: pushes
// wait while nf_session_judge runs. Judging uses all cores. Stops do not depend on the number of threads, but
// each tile has to get its own batches in the same order for results to be the same to the bit.
//
// Pointers. A pointer that is NULL where it must not be is NF_STATUS_NULL_POINTER. Beside a pointer to an
// array goes the number of its elements, which is checked. What cannot be checked: pointers must lead to as
// many elements as said, or to one object. Text ends with a zero byte and is UTF-8. The library keeps no pointer
// after a call, but for denoise and user of nf_session_new_denoised, and owns what it returns.
//
// Pictures are rows from the top, pixels from the left, three floats a pixel: linear red, green and blue with
// the primaries of Rec. 709. Floats that are not finite do not count as samples.

#ifndef NOISEFLOOR_H
#define NOISEFLOOR_H

// Generated from the sources of noisefloor-capi. Do not edit; see header.rs there.

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// A verdict after every step samples per pixel.
#define NF_SCHEDULE_EVERY 0

// Verdicts spaced by the expected need, in multiples of step.
#define NF_SCHEDULE_SPACED 1

// A verdict whenever a tile has half as many samples more, in multiples of step.
#define NF_SCHEDULE_GROWING 2

// The photographic operator (Reinhard et al. 2002) with an exposure by the log-average of the picture.
// Verdicts wait until every tile has samples.
#define NF_TONE_REINHARD 0

// Plain sRGB: multiply by the exposure, clamp, encode.
#define NF_TONE_SRGB 1

// nf_background_judge waits until there is room for the pass.
#define NF_FULL_WAIT 0

// The pass is added to the one before: the renderer never waits.
#define NF_FULL_MERGE 1

// The tile is open: it gets more samples.
#define NF_REASON_OPEN 0

// Nobody would see noise in it.
#define NF_REASON_CONVERGED 1

// It has as many samples as are allowed.
#define NF_REASON_MAX_SPP 2

// Closed by the caller: there is no more time.
#define NF_REASON_TIME_LIMIT 3

// Closed by the caller: somebody cancelled.
#define NF_REASON_CANCELLED 4

// Closed by the caller: the renderer failed.
#define NF_REASON_FAILED 5

// Nothing keeps the tile open.
#define NF_OPEN_FOR_NOTHING 0

// What is wrong with the tile, mostly its noise, would be seen.
#define NF_OPEN_FOR_NOISE 1

// The exposure of the picture is not known well enough.
#define NF_OPEN_FOR_EXPOSURE 2

// Of light that few samples have met elsewhere, as much as the tile is likely to lack would be seen.
#define NF_OPEN_FOR_UNMET_LIGHT 3

// So few samples that neither noise in few pixels is known yet, nor what light none of them has met.
#define NF_OPEN_FOR_FEW_SAMPLES 4

// Doubts about the samples themselves: see the warnings.
#define NF_OPEN_FOR_DOUBT 5

// The search goes on.
#define NF_SEARCH_SEARCHING 0

// One picture with this setting shows nothing that should not be seen.
#define NF_SEARCH_FOUND 1

// Even the finest setting is not enough.
#define NF_SEARCH_AT_FINEST 2

// Settings down to the finest give the same pictures: the renderer ignores the setting, or reaches another limit first.
#define NF_SEARCH_UNCHANGED 3

// More samples do not make it better: what is wrong is no noise, few samples find the light, or the pictures are not independent.
#define NF_SEARCH_NOT_FALLING 4

// Finer settings leave as much, since the pixels that make it have the most samples that the renderer takes.
#define NF_SEARCH_CAPPED 5

// How a call ended. nf_last_error has the words.
typedef enum {
    // Done.
    NF_STATUS_OK = 0,
    // A pointer is NULL that must not be, or not aligned for what it leads to.
    NF_STATUS_NULL_POINTER = 1,
    // A parameter is out of its range.
    NF_STATUS_ARGUMENT = 2,
    // An array, a picture or a tile has another size than it must have.
    NF_STATUS_SIZE = 3,
    // A tile that does not exist, or a batch without new samples.
    NF_STATUS_BATCH = 4,
    // A model file is damaged, foreign, or made for another version.
    NF_STATUS_MODEL = 5,
    // The model cannot judge this: it needs a reference, other tiles, or other viewing conditions.
    NF_STATUS_CRITERION = 6,
    // A checkpoint is damaged, foreign, or of another job.
    NF_STATUS_CHECKPOINT = 7,
    // A file cannot be read or written.
    NF_STATUS_IO = 8,
    // Not known yet, or never: the call says which.
    NF_STATUS_UNAVAILABLE = 9,
    // A mistake inside the library. Please report it.
    NF_STATUS_INTERNAL = 10,
    // There is not enough memory for the picture, or for work on all of it. The session is as it was.
    NF_STATUS_MEMORY = 11,
    // Samples cannot be what they are said to be, such as a batch that contains the one before. No tile is done
    // by them.
    NF_STATUS_FAULT = 12,
    // A handle that was freed, is of another kind, or does not come from this library.
    NF_STATUS_HANDLE = 13,
} NfStatus;

// A session on a thread of its own: the renderer hands over a pass and goes on.
typedef struct NfBackground NfBackground;

// A trained model with the share of people who are to see no noise. It never changes, and any
// number of sessions can be made from it.
typedef struct NfOracle NfOracle;

// The search for the setting of a renderer at which nobody sees noise: its noise threshold, or samples per pixel.
typedef struct NfSearch NfSearch;

// Film, oracle and limits of one picture.
typedef struct NfSession NfSession;

// How radiance is displayed, for NfParams: a table, or a .cube file.
typedef struct NfTone NfTone;

// Parameters of a session. Let nf_params_default fill them in, then change some.
typedef struct {
    // Edge of a tile in pixels, 16 to 512; tiles of the last column and row have half to one and a half times
    // as many. Default: 128.
    uint32_t tile;
    // When tiles are judged: NF_SCHEDULE_SPACED (default), _EVERY or _GROWING.
    uint32_t schedule;
    // The step of the schedule in samples per pixel, at least 2. Default: 8.
    uint64_t step;
    // Fewest samples per pixel at which a tile may stop. Default: 16.
    uint64_t min_spp;
    // Samples per pixel at which every tile stops, at least 2. Default: 10000.
    uint64_t max_spp;
    // Verdicts in a row that must say "converged" before a tile stops, at least 1. Default: 1.
    uint32_t consecutive;
    // How radiance is displayed: NF_TONE_REINHARD (default) or NF_TONE_SRGB. What people see depends on it.
    uint32_t tone_mapping;
    // For NF_TONE_REINHARD: what the log-average luminance becomes, above 0. Default: 0.18.
    float key;
    // For NF_TONE_REINHARD: smallest exposed luminance that becomes white, or 0 (default) for none.
    float white;
    // For NF_TONE_SRGB, and with tone: factor on radiance, above 0. Default: 1.
    float exposure;
    // Whose thresholds, as a line T' = slope * T + offset from those of the observers in the training data.
    // slope is at least 0. Default: 1.
    double audience_slope;
    // The offset of that line in samples per pixel. Default: 0.
    double audience_offset;
    // On which display the picture is seen and from how far, as text such as "desk" or
    // "ppd=60,peak=300,black=0.3,ambient=100"; "desk,fps=24" for a frame of a film whose noise is new in every
    // frame. NULL (default) for "desk". Read by nf_session_new only.
    const char *viewing;
    // A tone mapping of your own, of nf_tone_of_cube or nf_tone_of_table; tone_mapping counts no more then. NULL
    // (default) for none. Read when the parameters are.
    const NfTone *tone;
} NfParams;

// Denoises a whole picture, noisy, into denoised: each has 3 * width * height floats. albedo and normal are NULL, or
// as large. What it writes hangs on these arguments alone. Returns 0, or anything else if it failed. It cannot use
// sessions, and must not throw: an exception that leaves it ends the program.
typedef int32_t (*NfDenoise)(void *user,
                             uint32_t width,
                             uint32_t height,
                             const float *noisy,
                             const float *albedo,
                             const float *normal,
                             float *denoised);

// A rectangle of pixels that stops as a whole. Tiles lie in rows from the top left.
typedef struct {
    // Its number: 0 to nf_session_tile_count - 1.
    size_t index;
    // Left edge in pixels.
    size_t x;
    // Top edge in pixels.
    size_t y;
    // Width in pixels.
    size_t width;
    // Height in pixels.
    size_t height;
} NfTile;

// What an open tile needs next.
typedef struct {
    // The tile.
    NfTile tile;
    // Number of the first new sample: a renderer that derives its random numbers from pixel and sample
    // number repeats none.
    uint64_t first;
    // New samples per pixel. Fewer or more are fine.
    uint64_t spp;
    // For quasi-random points: which sequence of the pixel the samples belong to, 0 or 1. Scramble the two
    // independently.
    uint32_t sequence;
    // Index of the first new point in that sequence.
    uint64_t point;
} NfRequest;

// Where a session in the background stands.
typedef struct {
    // Passes that were judged.
    uint64_t judged;
    // Passes that were handed over and are not judged yet.
    size_t pending;
    // Samples per pixel that the next pass over the whole picture should have; 0 when all tiles are done.
    uint64_t next_pass;
    // Samples per pixel that open tiles can still get before they stop at max_spp, beside all that was handed over. A renderer that
    // has summed up as many waits for the verdict, by nf_background_finish: what it would render meanwhile is beyond the stop. 0
    // when all tiles are done, or will be with the passes that are pending, as far as is known.
    uint64_t spp_left;
    // Open tiles, after the last pass that was judged.
    size_t open_tiles;
    // Stops so far. A tile that was open again counts twice.
    size_t stops;
    // Warnings so far, for nf_background_warning.
    size_t warnings;
} NfBackgroundState;

// Where a tile stands.
typedef struct {
    // Samples per pixel; if the tile is done, when it stopped.
    uint64_t spp;
    // Samples per pixel at which the oracle expects the tile to be free of visible noise; 0 if it cannot
    // tell.
    uint64_t expected_spp;
    // Probability that an observer sees no difference from the converged picture, by the last verdict; NaN
    // before the first.
    float probability;
    // NF_REASON_OPEN, or why the tile is done.
    uint32_t reason;
    // What keeps the tile from being done, or has kept it until a limit: NF_OPEN_FOR_NOTHING, or another of these.
    uint32_t open_for;
    // Whether the tile's texture is unlike all that the model was trained on: treat the verdict with care.
    bool unfamiliar;
} NfTileState;

// What samples were like that were pushed.
typedef struct {
    // Samples, over all pixels, that were left out because their batch was not finite.
    uint64_t rejected;
    // Samples, over all pixels, whose batch had negative luminance; since a resume.
    uint64_t negative;
    // Warnings: what is likely to be wrong with the samples, as of the last nf_session_judge. See
    // nf_session_warning.
    size_t warnings;
} NfSampleCounts;

// Renders the mean of spp new samples of each pixel of a tile, of which it has rendered first samples before:
// mean has room for 3 * width * height floats of the tile. Returns 0, or anything else if it failed.
// It must not throw: an exception that leaves it ends the program.
typedef int32_t (*NfRender)(void *user, NfTile tile, uint64_t first, uint64_t spp, float *mean);

// What to do next in a search, or how it ended.
typedef struct {
    // One of NF_SEARCH_...
    uint32_t ending;
    // While searching: what two pictures are to be rendered with, each with a seed of its own, the same seeds in
    // every step.
    double each;
    // While searching: one picture with this setting is as good as the mean of the two, if noise follows the setting. At
    // NF_SEARCH_FOUND: the setting that is enough.
    double setting;
} NfSearchStep;

// How far the mean of two pictures is from what may be seen, in its worst place.
typedef struct {
    // What is wrong over what may be wrong: 1 or less passes. Infinite where it cannot be told.
    double ratio;
    // The worst place, a column and a row.
    uint32_t x;
    uint32_t y;
    // A number that follows from the pictures, by which settings without effect are noticed; 0 if it is not known.
    uint64_t pictures;
    // The same ratio of one picture whose threshold is finer by the root of two: that of the mean where the samples of pixels
    // follow the threshold, and at most 1.41 times that where they do not. 0 if it is not known: then only pictures that were
    // rendered speak for a setting.
    double alone;
    // The ratio below which no finer threshold gets, since the pixels that make it have the most samples that the renderer
    // takes; 0 if it is not known. nf_excess cannot know.
    double floor;
} NfExcess;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// What went wrong in the last call on this thread that failed, in English, for people; an empty string if
// none has. Valid until the next call on this thread fails, or the thread ends.
const char *nf_last_error(void);

// What is likely wrong with the pictures of the last nf_excess or nf_excess_denoised on this thread, such as another
// exposure of one, in English, one a line; an empty string if nothing is. Valid until the next such call on this
// thread, or the thread ends.
const char *nf_last_warnings(void);

// The version of the library, as text: "0.1.0". Lives as long as the program.
const char *nf_version(void);

// Makes an oracle from the model inside the library, which was trained on human data and judges by half
// buffers. people, between 0 and 1, is the share of people who are to see no noise where a tile stops, in a
// scene like those that people were asked about: 0.95 is that of the paper, and the default of all other
// languages. The caller frees the oracle with nf_oracle_free.
NfStatus nf_oracle_bundled(float people,
                           NfOracle **oracle);

// As nf_oracle_bundled, with a model that "noisefloor-lab train" has written to a file.
NfStatus nf_oracle_load(const char *path, float people, NfOracle **oracle);

// Frees an oracle; sessions made from it do not need it. NULL is ignored, a second time is
// NF_STATUS_HANDLE.
NfStatus nf_oracle_free(NfOracle *oracle);

// Fills in the defaults.
NfStatus nf_params_default(NfParams *params);

// Reads what `noisefloor calibrate` has measured: for NfParams.audience_slope and NfParams.viewing. path is a
// file, of whose people nine of ten will be content; NULL is the user's own, and if nobody is calibrated,
// slope is 1 and viewing the default. viewing is cut to bytes - 1 bytes and ended by a zero; 200 bytes hold
// any.
NfStatus nf_eyes(const char *path,
                 double *slope,
                 char *viewing,
                 size_t bytes);

// Starts a session for a picture of width x height pixels: each edge up to 65536, 2^28 pixels in all. It
// takes 36 bytes a pixel. params is NULL for the defaults. The caller frees the session with
// nf_session_free.
NfStatus nf_session_new(size_t width,
                        size_t height,
                        const NfOracle *oracle,
                        const NfParams *params,
                        NfSession **session);

// As nf_session_new, for pictures that are denoised before anyone sees them: a tile is done when what denoise makes of
// the picture has lost at most lost just-objectionable differences (JOD) against the converged one, 0.3 say, 19 of 20 tiles
// by the vision model; nobody has been asked about denoised pictures. See also nf_session_undenoised. Both halves of the samples are denoised apart, so a
// verdict takes two calls, on whichever thread calls nf_session_judge: params is NULL for the defaults with the schedule
// NF_SCHEDULE_GROWING, and step and min_spp of 48. denoise and user must last as long as the session. first_hits is
// NULL, or four pictures of floats floats each, which are copied: albedo and normal for one half, then for the other,
// independent of each other; nf_first_hits_are_clean knows whether denoise may take them at their word. passes is 1, or 4
// if the finished picture is made by nf_mirror_mean.
NfStatus nf_session_new_denoised(size_t width,
                                 size_t height,
                                 NfDenoise denoise,
                                 void *user,
                                 double lost,
                                 const float *const *first_hits,
                                 size_t floats,
                                 uint32_t passes,
                                 const NfParams *params,
                                 NfSession **session);

// Frees a session, once calls on it have returned. NULL is ignored, a second time is NF_STATUS_HANDLE.
NfStatus nf_session_free(NfSession *session);

// The number of tiles; 0 if session is NULL.
size_t nf_session_tile_count(const NfSession *session);

// Where a tile lies.
NfStatus nf_session_tile(const NfSession *session, size_t index, NfTile *tile);

// What the open tiles need next, into an array for at least as many requests as there are tiles (capacity says how
// many). count becomes the number of requests: 0 when all tiles are done.
NfStatus nf_session_requests(const NfSession *session,
                             NfRequest *requests,
                             size_t capacity,
                             size_t *count);

// Samples per pixel that the next pass over the whole picture should have, for a renderer of whole frames: what one
// half lacks until the first of the open tiles can be judged, so that nothing has to be read back from a GPU before.
// spp becomes 0 when all tiles are done.
NfStatus nf_session_next_pass(const NfSession *session,
                              uint64_t *spp);

// Judges the tiles that are due. newly_done, which may be NULL, becomes the number of tiles that are now
// done and were not before. The first verdicts wait until every open tile has samples, unless tone_mapping
// is NF_TONE_SRGB. When the exposure of the finished picture turns out to be another than was estimated,
// tiles that were done can be open again: render until there are no requests.
NfStatus nf_session_judge(const NfSession *session,
                          size_t *newly_done);

// Just-objectionable differences that each tile to be shown has lost, by its last verdict: a double for each tile, NaN
// before the first, into an array for at least as many (capacity says how many). NF_STATUS_UNAVAILABLE if the session
// has no denoiser.
NfStatus nf_session_jods_lost(const NfSession *session,
                              double *lost,
                              size_t capacity);

// Which tiles are to be shown as rendered instead of denoised: their noise has lost no more than is allowed, and what the
// denoiser makes of them has. A bool for each tile, into an array for at least as many (capacity says how
// many); false before the first verdict. NF_STATUS_UNAVAILABLE if the session
// has no denoiser.
NfStatus nf_session_undenoised(const NfSession *session,
                               bool *undenoised,
                               size_t capacity);

// Whether a denoiser may take albedo and normals at their word (cleanAux of Open Image Denoise): whether the noise by which
// both halves differ is too little to be seen in a denoised picture. first_hits as in nf_session_new_denoised.
NfStatus nf_first_hits_are_clean(size_t width,
                                 size_t height,
                                 const float *const *first_hits,
                                 size_t floats,
                                 bool *clean);

// Writes into denoised the mean of what denoise makes of a picture and of its mirror images: it has less of what denoisers get
// wrong by chance. albedo and normal are NULL, or mirrored with it. All pictures have floats floats, 3 * width * height.
// passes is 1 or 4.
NfStatus nf_mirror_mean(size_t width,
                        size_t height,
                        NfDenoise denoise,
                        void *user,
                        uint32_t passes,
                        const float *noisy,
                        const float *albedo,
                        const float *normal,
                        float *denoised,
                        size_t floats);

// A .cube file: a 1D LUT, a 3D LUT, or a 1D one before a 3D one. text is its content, bytes long. input says how
// radiance is encoded before it: "linear" (also NULL), "srgb", "acescct", or "log2:LOW,HIGH" for stops from middle grey
// (0.18) that become 0 and 1. What it returns is taken for sRGB-encoded display values. The caller frees it with
// nf_tone_free, parameters and sessions keep what they need.
NfStatus nf_tone_of_cube(const char *text,
                         size_t bytes,
                         const char *input,
                         NfTone **tone);

// A table of display values over radiance, such as a filmic curve, with edge entries along each axis, 2 to 65, red
// fastest: floats = 3 * edge^3 display values (sRGB-encoded red, green and blue, 0 to 1). Radiance x, times
// exposure, lies at s(1 + x / toe) / s(1 + top / toe) of an axis, where s(2^n * (1 + f)) = n + f is log2
// made linear between powers of two: 0 is the first entry and top, or more, the last. Between entries
// values are interpolated linearly. NF_STATUS_ARGUMENT if the values are no display values, such as those of 8 bits. The
// caller frees it with nf_tone_free, parameters and sessions keep what they need.
NfStatus nf_tone_of_table(float toe,
                          float top,
                          const float *table,
                          size_t floats,
                          size_t edge,
                          NfTone **tone);

// Frees a tone mapping. NULL is ignored, a second time is NF_STATUS_HANDLE.
NfStatus nf_tone_free(NfTone *tone);

// Adds the mean of spp new samples per pixel of a tile: rows of the tile from the top, floats = 3 * width *
// height of the tile. Tiles that are done accept samples, too: they improve, and stay done.
NfStatus nf_session_push(const NfSession *session,
                         size_t tile,
                         uint64_t spp,
                         const float *mean,
                         size_t floats);

// As nf_session_push, for a renderer that keeps running means: the mean of all total samples per pixel of
// the tile so far. The new samples are what it has more than the session.
NfStatus nf_session_push_running(const NfSession *session,
                                 size_t tile,
                                 uint64_t total,
                                 const float *mean,
                                 size_t floats);

// As nf_session_push, from a picture of the whole image with this many channels per pixel, of which the
// first three are red, green and blue: floats = channels * width * height of the image. Only the tile is
// read.
NfStatus nf_session_push_image(const NfSession *session,
                               size_t tile,
                               uint64_t spp,
                               const float *image,
                               size_t floats,
                               size_t channels);

// Lets a session judge in the background, on a thread of its own. At most `waiting` passes, and at least one, wait
// behind the one that is being judged; when_full is NF_FULL_WAIT or NF_FULL_MERGE. Until nf_background_end gives the
// session back, calls on it are NF_STATUS_ARGUMENT, but for nf_session_tile_count, nf_session_tile and
// nf_session_free. Stops are those of the same session without this, to the bit, and come later.
NfStatus nf_background_begin(const NfSession *session,
                             size_t waiting,
                             uint32_t when_full,
                             NfBackground **background);

// Adds a batch to the pass: the mean of spp new samples per pixel of the whole picture, with this many channels per
// pixel, of which the first three are red, green and blue; floats = channels * width * height. It is copied, also from
// memory that is pinned or mapped for a GPU. Tiles that are done when it is their turn have the samples at the end.
NfStatus nf_background_push_image(const NfBackground *background,
                                  uint64_t spp,
                                  const float *image,
                                  size_t floats,
                                  size_t channels);

// As nf_background_push_image, for a renderer that keeps running means: the mean of all total samples per pixel so far.
NfStatus nf_background_push_running_image(const NfBackground *background,
                                          uint64_t total,
                                          const float *image,
                                          size_t floats,
                                          size_t channels);

// Adds a batch of one tile to the pass: as nf_session_push, later.
NfStatus nf_background_push(const NfBackground *background,
                            size_t tile,
                            uint64_t spp,
                            const float *mean,
                            size_t floats);

// Hands over the pass: all batches since the last call. They are pushed and judged in the background. What fails
// there, such as NF_STATUS_FAULT, is the status of this or a later call.
NfStatus nf_background_judge(const NfBackground *background);

// Where the session stands, without waiting. Its status is what failed in the background, if anything has.
NfStatus nf_background_state(const NfBackground *background,
                             NfBackgroundState *state);

// What the open tiles wanted after the last pass that was judged, as nf_session_requests. What was handed over since
// is not in it, so number samples yourself instead of by `first` and `point`.
NfStatus nf_background_requests(const NfBackground *background,
                                NfRequest *requests,
                                size_t capacity,
                                size_t *count);

// One of the warnings that nf_background_state has counted, by its number from 0 on: as nf_session_warning.
NfStatus nf_background_warning(const NfBackground *background,
                               size_t index,
                               char *text,
                               size_t bytes);

// Waits until no pass waits. Its status is what failed in the background, if anything has.
NfStatus nf_background_finish(const NfBackground *background);

// Waits until no pass waits, gives the session back to its handle, with samples that came after their tile had
// stopped, and frees the background. What failed in a push or a verdict is no error of this call: ask
// nf_background_finish before. NULL is ignored, a second time is NF_STATUS_HANDLE.
NfStatus nf_background_end(NfBackground *background);

// Where all tiles stand, in their order, into an array for at least as many states as there are tiles (capacity says
// how many).
NfStatus nf_session_states(const NfSession *session,
                           NfTileState *states,
                           size_t capacity);

// The number of open tiles; 0 when all are done.
NfStatus nf_session_open_tiles(const NfSession *session, size_t *open);

// Ends every open tile for NF_REASON_TIME_LIMIT, NF_REASON_CANCELLED or NF_REASON_FAILED.
NfStatus nf_session_close_all(const NfSession *session, uint32_t reason);

// Samples still to be taken, over all pixels, as the oracle expects; NF_STATUS_UNAVAILABLE while an open
// tile has no expectation.
NfStatus nf_session_expected_samples(const NfSession *session,
                                     uint64_t *samples);

// Counts samples that are not as they should be.
NfStatus nf_session_sample_counts(const NfSession *session, NfSampleCounts *counts);

// The text of a warning, 0 to NfSampleCounts.warnings - 1, in English, for people: cut to bytes - 1 bytes and
// ended by a zero. 400 bytes hold any.
NfStatus nf_session_warning(const NfSession *session,
                            size_t index,
                            char *text,
                            size_t bytes);

// Says whether neighbouring pixels have noise in common, by a pixel filter, a denoiser or a Markov chain: no
// warning says so then.
NfStatus nf_session_share_pixels(const NfSession *session,
                                 bool shared);

// Says that what is pushed is linear radiance, so that no warning asks: where all batches have
// one size, nothing tells that from values that were encoded for a screen.
NfStatus nf_session_set_linear(const NfSession *session);

// The picture: the mean of all samples, floats = 3 * width * height of the image. Pixels without samples are
// black.
NfStatus nf_session_image(const NfSession *session,
                          float *image,
                          size_t floats);

// How visible the noise is at each pixel, 1 where it is just seen: floats = width * height of the image, NaN
// where there is no evidence. Costs as much as a verdict on every tile. NF_STATUS_UNAVAILABLE before
// the first verdict, or if the model makes no map.
NfStatus nf_session_visible_noise(const NfSession *session,
                                  float *map,
                                  size_t floats);

// Writes a snapshot of the session, for resuming it. The file is whole or not there. job is text that names
// all the samples depend on: scene, seed, options of the renderer.
NfStatus nf_session_save(const NfSession *session,
                         const char *job,
                         const char *path);

// Puts a session back where nf_session_save found it. The session must have been made with the same size,
// parameters and oracle, and job must be the same. If the renderer repeats its samples, all that follows is
// the same to the bit as without the interruption, warnings included. Pixels share samples if either
// session was told so by nf_session_share_pixels. On failure the session is as it was.
NfStatus nf_session_resume(const NfSession *session,
                           const char *job,
                           const char *path);

// As nf_session_save, into memory instead of a file: size becomes the number of bytes. bytes has room for
// capacity; if it is NULL, only size is written.
NfStatus nf_session_checkpoint(const NfSession *session,
                               const char *job,
                               uint8_t *bytes,
                               size_t capacity,
                               size_t *size);

// As nf_session_resume, from the bytes of nf_session_checkpoint or of a file of nf_session_save.
NfStatus nf_session_restore(const NfSession *session,
                            const char *job,
                            const uint8_t *bytes,
                            size_t size);

// Checks what sessions rely on: that samples of a renderer are new, independent of each other and, unless
// shared_pixels is true, from pixel to pixel, and that their number means what it says. With repeats_samples,
// also that they follow from pixel and sample number, however requests are cut. NF_STATUS_FAULT and
// nf_last_error say what is wrong. render is called on this thread, some hundred times with tiles of 32 x 32
// pixels; 48 x 40 pixels are enough, and several times over from first = 0, which must restart nothing unless
// repeats_samples is true.
NfStatus nf_check(NfRender render,
                  void *user,
                  size_t width,
                  size_t height,
                  bool repeats_samples,
                  bool shared_pixels);

// Searches a noise threshold, such as from 0.2 down to 0.001. The caller frees it with nf_search_free.
NfStatus nf_search_of_threshold(double coarsest,
                                double finest,
                                NfSearch **search);

// Searches samples per pixel, such as from 16 to 4096. The caller frees it with nf_search_free.
NfStatus nf_search_of_samples(uint64_t least, uint64_t most, NfSearch **search);

// What to render next, or how the search ended. The same until nf_search_tell.
NfStatus nf_search_next(const NfSearch *search, NfSearchStep *step);

// Says what was found of the two pictures that nf_search_next asked for, once. NF_STATUS_ARGUMENT if it has not asked since, and
// for ratios that are negative or not a number.
NfStatus nf_search_tell(const NfSearch *search,
                        NfExcess excess);

// Frees a search. NULL is ignored, a second time is NF_STATUS_HANDLE.
NfStatus nf_search_free(NfSearch *search);

// How far the noise of the mean of two pictures is from what people do not see, where it is worst. a and b are
// linear radiance, floats = 3 * width * height values each, rendered with the same setting and different seeds. Of
// params, display and audience count; params may be NULL for the defaults. NF_STATUS_ARGUMENT if the pictures are
// the same, not finite, negative, or no two of one view with one exposure; nf_last_warnings has what is only likely to be
// wrong with them.
NfStatus nf_excess(const NfOracle *oracle,
                   const NfParams *params,
                   uint32_t width,
                   uint32_t height,
                   const float *a,
                   const float *b,
                   size_t floats,
                   NfExcess *excess);

// As nf_excess, for pictures that are denoised: denoised_a is what a denoiser makes of a, and denoised_b of b, each
// without a look at the other. The ratio is that of the just-objectionable differences (JOD) that the worst square of
// 64 pixels may have lost, 1.5 times the estimate, to lost, 0.3 say. Nobody has been asked about denoised pictures: the limit
// is a vision model's.
NfStatus nf_excess_denoised(double lost,
                            const NfParams *params,
                            uint32_t width,
                            uint32_t height,
                            const float *a,
                            const float *b,
                            const float *denoised_a,
                            const float *denoised_b,
                            size_t floats,
                            NfExcess *excess);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* NOISEFLOOR_H */
