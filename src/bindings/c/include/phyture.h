/* phyture: streams a calibrated model or a trained hybrid, one sample in, one prediction out. C99 and C++11.
 *
 * Units: SI and radians. Frames: local north-east-down, body axes nose-starboard-down; ZYX Euler angles; velocities and
 * accelerations are inertial ones written in body axes.
 *
 * Ownership: what `phyture_..._read` and `phyture_..._new` put into `*out` belongs to the caller, who gives it back once to the `..._free`
 * of its type. A stream keeps all that it needs: its model may be freed before it. Texts that a function returns belong to
 * the library or to the handle and are not freed.
 *
 * Errors: functions that can fail return a PhytureStatus. Where there is no handle yet the sentence that belongs to it is written to the
 * caller's buffer, cut to its length and ended with a zero; NULL and 0 for no sentence. A stream keeps its own: phyture_stream_message.
 * Texts are UTF-8.
 *
 * Threads: there is no global state. A PhytureModel may be used by several threads at once; a PhytureStream by one thread at a time,
 * not always the same one. Nothing is freed while a call uses it.
 *
 * Real time: phyture_stream_push works on the calling thread, waits for no other one, and allocates nothing, unless it fails with
 * PHYTURE_STATUS_MODEL, PHYTURE_STATUS_PREDICTION or PHYTURE_STATUS_PANIC, whose sentences are made on the heap.
 *
 * Written by cbindgen from src/bindings/c; do not edit. */


#ifndef PHYTURE_H
#define PHYTURE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/*
 Numbers of a state: position, Euler angles, velocity, rates, controls.
 */
#define PHYTURE_STATES 16

/*
 Accelerations of a prediction.
 */
#define PHYTURE_ACCELERATIONS 6

/*
 What a call came to.
 */
typedef enum PhytureStatus {
  /*
   Done.
   */
  PHYTURE_STATUS_OK = 0,
  /*
   A pointer that has to point somewhere is NULL.
   */
  PHYTURE_STATUS_NULL = 1,
  /*
   An array has another length than it has to have.
   */
  PHYTURE_STATUS_LENGTH = 2,
  /*
   A file cannot be read, or is not what it should be.
   */
  PHYTURE_STATUS_FILE = 3,
  /*
   The model cannot be streamed like this: another step than the trained one, a formula that does not fit.
   */
  PHYTURE_STATUS_MODEL = 4,
  /*
   A number that was given is not finite. Nothing was taken.
   */
  PHYTURE_STATUS_NOT_FINITE = 5,
  /*
   The predicted accelerations are not finite. The sample was taken.
   */
  PHYTURE_STATUS_PREDICTION = 6,
  /*
   A fault of this library. The handle refuses everything from now on and can only be freed.
   */
  PHYTURE_STATUS_PANIC = 7,
} PhytureStatus;

/*
 Where a sample lies beside what calibration and training saw.
 */
typedef enum PhyturePlace {
  /*
   The model does not know: a model file, or a hybrid of before there were envelopes.
   */
  PHYTURE_PLACE_UNKNOWN,
  /*
   Inside: each quantity in its range, and the sample near to one that was seen.
   */
  PHYTURE_PLACE_INSIDE,
  /*
   A quantity is beyond its range: PhyturePrediction.beyond says which.
   */
  PHYTURE_PLACE_BEYOND,
  /*
   Each quantity is in its range, but all together farther from everything that was seen than any sample of the training.
   */
  PHYTURE_PLACE_APART,
} PhyturePlace;

/*
 Places in a state.
 */
typedef enum PhytureState {
  /*
   North, m.
   */
  PHYTURE_STATE_X,
  /*
   East, m.
   */
  PHYTURE_STATE_Y,
  /*
   Down, m; height above ground is -z.
   */
  PHYTURE_STATE_Z,
  /*
   Roll, rad.
   */
  PHYTURE_STATE_ROLL,
  /*
   Pitch, rad.
   */
  PHYTURE_STATE_PITCH,
  /*
   Yaw, rad.
   */
  PHYTURE_STATE_YAW,
  /*
   Inertial velocity along the nose, m/s.
   */
  PHYTURE_STATE_VX,
  /*
   Inertial velocity to starboard, m/s.
   */
  PHYTURE_STATE_VY,
  /*
   Inertial velocity along body down, m/s.
   */
  PHYTURE_STATE_VZ,
  /*
   Roll rate, rad/s.
   */
  PHYTURE_STATE_WX,
  /*
   Pitch rate, rad/s.
   */
  PHYTURE_STATE_WY,
  /*
   Yaw rate, rad/s.
   */
  PHYTURE_STATE_WZ,
  /*
   Lateral cyclic, as it was logged for calibration, about -1 to 1.
   */
  PHYTURE_STATE_U1,
  /*
   Longitudinal cyclic.
   */
  PHYTURE_STATE_U2,
  /*
   Tail.
   */
  PHYTURE_STATE_U3,
  /*
   Collective.
   */
  PHYTURE_STATE_U4,
} PhytureState;

/*
 Places in the arrays of a prediction.
 */
typedef enum PhytureAcceleration {
  /*
   d(vx)/dt of the body component, m/s².
   */
  PHYTURE_ACCELERATION_VX_DOT,
  /*
   d(vy)/dt, m/s².
   */
  PHYTURE_ACCELERATION_VY_DOT,
  /*
   d(vz)/dt, m/s².
   */
  PHYTURE_ACCELERATION_VZ_DOT,
  /*
   d(wx)/dt, rad/s².
   */
  PHYTURE_ACCELERATION_WX_DOT,
  /*
   d(wy)/dt, rad/s².
   */
  PHYTURE_ACCELERATION_WY_DOT,
  /*
   d(wz)/dt, rad/s².
   */
  PHYTURE_ACCELERATION_WZ_DOT,
} PhytureAcceleration;

/*
 A trained hybrid or a model file, loaded. It does not change: several threads may make streams of it at once.
 */
typedef struct PhytureModel PhytureModel;

/*
 A model that takes one sample at a time. One thread at a time uses it.
 */
typedef struct PhytureStream PhytureStream;

/*
 A prediction and its parts, in the order of PhytureAcceleration: m/s² and rad/s².
 */
typedef struct PhyturePrediction {
  /*
   The predicted accelerations: physics + linear + network; for a network that does not learn a residual, what it says alone. NaN while
   the prediction is not complete.
   */
  double acceleration[PHYTURE_ACCELERATIONS];
  /*
   The calibrated model alone; there from the first sample.
   */
  double physics[PHYTURE_ACCELERATIONS];
  /*
   What the linear history says; 0 where there is none.
   */
  double linear[PHYTURE_ACCELERATIONS];
  /*
   What the network says; 0 where there is none, NaN while the prediction is not complete.
   */
  double network[PHYTURE_ACCELERATIONS];
  /*
   Half of the interval around the acceleration, made to hold 90 % of the measurements of flights like those of the training; NaN where
   there is none.
   */
  double half_width[PHYTURE_ACCELERATIONS];
  /*
   Where the sample lies beside what calibration and training saw. Outside neither prediction nor interval is backed by data.
   */
  enum PhyturePlace place;
  /*
   For PHYTURE_PLACE_BEYOND the quantity that is farthest out, an index for phyture_stream_envelope_name; else 0.
   */
  size_t beyond;
  /*
   Whether the network has its history: from the phyture_stream_history-th sample on. A model without a network is always complete.
   */
  bool complete;
} PhyturePrediction;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/*
 What a status means, in general; a static text. A number that is no PhytureStatus is called unknown.
 */
const char *phyture_status_text(int32_t status);

/*
 Version of the library, as in "0.1.0"; a static text.
 */
const char *phyture_version(void);

/*
 Reads a trained hybrid: the `network.safetensors` of a run folder, which holds physics, network and scales.

 `*out` is the hybrid, to be freed with phyture_model_free; NULL where it fails: PHYTURE_STATUS_NULL, PHYTURE_STATUS_FILE.

 # Safety
 `path` is a text that ends with a zero. `out` can be written. `message` is NULL, or `message_length` bytes there can be written.
 */
enum PhytureStatus phyture_hybrid_read(const char *path,
                                       struct PhytureModel **out,
                                       char *message,
                                       size_t message_length);

/*
 Reads a model file (TOML): physics without a network.

 `*out` is the model, to be freed with phyture_model_free; NULL where it fails: PHYTURE_STATUS_NULL, PHYTURE_STATUS_FILE.

 # Safety
 As phyture_hybrid_read.
 */
enum PhytureStatus phyture_model_read(const char *path,
                                      struct PhytureModel **out,
                                      char *message,
                                      size_t message_length);

/*
 Time between the samples that a hybrid was trained on, s; 0 for physics without a network, which takes any step; NaN for NULL.

 # Safety
 `model` is NULL, or came from phyture_hybrid_read or phyture_model_read and is not freed meanwhile.
 */
double phyture_model_step_s(const struct PhytureModel *model);

/*
 Frees a model; NULL is nothing. Its streams go on.

 # Safety
 `model` is NULL, or came from phyture_hybrid_read or phyture_model_read; it is not used any more, nor freed again.
 */
void phyture_model_free(struct PhytureModel *model);

/*
 Makes a stream. Samples have to come `step_s` seconds apart: a hybrid takes the step that it was trained at, or 0 for that; physics alone
 takes any.

 `*out` is the stream, to be freed with phyture_stream_free; NULL where it fails: PHYTURE_STATUS_NULL, PHYTURE_STATUS_MODEL. All
 memory is asked for here.

 # Safety
 `model` came from phyture_hybrid_read or phyture_model_read. `out` can be written. `message` is NULL, or `message_length` bytes there
 can be written.
 */
enum PhytureStatus phyture_stream_new(const struct PhytureModel *model,
                                      double step_s,
                                      struct PhytureStream **out,
                                      char *message,
                                      size_t message_length);

/*
 Takes the next sample and predicts its accelerations.

 `state` is PHYTURE_STATES numbers in the order of PhytureState; `own` has one number for each of phyture_stream_own_name, in the unit of
 the log, and is NULL with 0 where there are none. Where it fails `*out` is as it was: PHYTURE_STATUS_NULL, PHYTURE_STATUS_LENGTH and
 PHYTURE_STATUS_NOT_FINITE (the sample was not taken, and the next one is taken to follow the last that was), PHYTURE_STATUS_PREDICTION,
 PHYTURE_STATUS_PANIC. phyture_stream_message has the sentence.

 # Safety
 `stream` came from phyture_stream_new, and no other thread uses it. `state` and `own` point at as many numbers as their lengths say.
 `out` can be written.
 */
enum PhytureStatus phyture_stream_push(struct PhytureStream *stream,
                                       const double *state,
                                       size_t state_length,
                                       const double *own,
                                       size_t own_length,
                                       struct PhyturePrediction *out);

/*
 Starts anew: the next sample is the first one, at time `start_s` in seconds (0 after phyture_stream_new), and the history is empty.
 Fails with PHYTURE_STATUS_NULL, PHYTURE_STATUS_NOT_FINITE, PHYTURE_STATUS_PANIC.

 # Safety
 `stream` is NULL, or came from phyture_stream_new, and no other thread uses it.
 */
enum PhytureStatus phyture_stream_reset(struct PhytureStream *stream,
                                        double start_s);

/*
 Samples until a prediction is complete: the network's history, 1 without a network; 0 for NULL.

 # Safety
 `stream` is NULL, or came from phyture_stream_new, and no other thread uses it.
 */
size_t phyture_stream_history(const struct PhytureStream *stream);

/*
 How many columns of the log's own (motor commands, rotor speeds) are read besides the state; 0 for NULL, and for most models.

 # Safety
 `stream` is NULL, or came from phyture_stream_new, and no other thread uses it.
 */
size_t phyture_stream_own_count(const struct PhytureStream *stream);

/*
 Name of one of these columns, as in the log; NULL where there is none. The text belongs to the stream.

 # Safety
 `stream` is NULL, or came from phyture_stream_new, and no other thread uses it.
 */
const char *phyture_stream_own_name(const struct PhytureStream *stream, size_t index);

/*
 How many quantities the envelope asks for; 0 for NULL, and for a model without an envelope.

 # Safety
 `stream` is NULL, or came from phyture_stream_new, and no other thread uses it.
 */
size_t phyture_stream_envelope_count(const struct PhytureStream *stream);

/*
 Name of one of these quantities, a state or a column of the log's own; NULL where there is none. The text belongs to the stream.

 # Safety
 `stream` is NULL, or came from phyture_stream_new, and no other thread uses it.
 */
const char *phyture_stream_envelope_name(const struct PhytureStream *stream,
                                         size_t index);

/*
 Smallest and largest value of one of these quantities in the training, in its unit; PHYTURE_STATUS_LENGTH where there is no such quantity, and
 `low` and `high` are then as they were.

 # Safety
 `stream` is NULL, or came from phyture_stream_new, and no other thread uses it. `low` and `high` are NULL or can be written.
 */
enum PhytureStatus phyture_stream_envelope_range(const struct PhytureStream *stream,
                                                 size_t index,
                                                 double *low,
                                                 double *high);

/*
 Lets the network look at every `samples`-th sample only and holds what it said in between; physics and linear history are of each sample all the
 same. 1 after phyture_stream_new. Without a network nothing changes. Fails with PHYTURE_STATUS_NULL, PHYTURE_STATUS_LENGTH for 0,
 PHYTURE_STATUS_PANIC.

 # Safety
 `stream` is NULL, or came from phyture_stream_new, and no other thread uses it.
 */
enum PhytureStatus phyture_stream_network_every(struct PhytureStream *stream,
                                                size_t samples);

/*
 The sentence about the last phyture_stream_push, phyture_stream_reset or phyture_stream_network_every; empty where that was done, NULL for NULL. The text belongs to the stream and
 stays as it is until the next of these calls.

 # Safety
 `stream` is NULL, or came from phyture_stream_new, and no other thread uses it.
 */
const char *phyture_stream_message(const struct PhytureStream *stream);

/*
 Frees a stream; NULL is nothing.

 # Safety
 `stream` is NULL, or came from phyture_stream_new; it is not used any more, nor freed again.
 */
void phyture_stream_free(struct PhytureStream *stream);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* PHYTURE_H */
