#ifndef HAMELIN_CONTROL_HAMELIN_CONTROL_H
#define HAMELIN_CONTROL_HAMELIN_CONTROL_H
/*
 * The controller of an arm for programs in C and other languages; controller.hpp and world.hpp
 * describe what it does. Functions that can fail return 0 on success; otherwise they write one
 * line, nul-terminated, to `error` (error_size bytes; null: not written) and have no effect. A null
 * pointer where a value is expected is such a failure; no function throws or aborts. Structs begin
 * with their size in bytes, and fields are only appended to them. Numbers that are optional have a
 * default, which 0 selects; negative numbers and NaN are refused. SI units and radians; poses are
 * in the world frame.
 *
 * hamelin_controller_tick is called by one thread. It neither allocates nor locks, unless the
 * planner declares that it does. All functions that stop the arm or change goals, parameters, load
 * or the world may be called by any thread at any time; those that belong to the thread of
 * hamelin_controller_tick say so.
 *
 * JSON has the form of a scene file, docs/schema/scene.schema.json. Relative paths in it start from
 * `folder`, or from that of the scene if `folder` is null. Messages name the place in a scene:
 * "goals: /goals/0/q: ...".
 */
#include <stddef.h>
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif

typedef struct hamelin_controller hamelin_controller;

typedef struct hamelin_controller_options {
  uint32_t struct_size;
  const char* scene_file; /* robot, map, obstacles, goals, limits, planner, control period */
  const char* const* plugin_directories; /* where the planner is searched for, in order */
  size_t plugin_directory_count;
  size_t obstacles_max;              /* the largest number of obstacles at a time; 0: 64 */
  int32_t position;                  /* 1: q_next and v_next are computed */
  double acceleration_max, jerk_max; /* bounds of that motion; 0: 15 rad/s^2, 5000 rad/s^3 */
  /* Receives the planner's messages (not nul-terminated) and the first overrun of its deadline, on
   * the thread that calls the planner, with HAMELIN_LOG_INFO or _WARNING of the plugin interface as
   * level; may be null. */
  void (*log)(void* context, int32_t level, const char* text, size_t size);
  void* log_context;
  /* The planner has failed after so many answers in a row beyond its deadline. 0: no clock is read,
   * and hamelin_answer has neither planner_s nor overruns. */
  int32_t late_answers_max;
  /* Of the poses that hamelin_controller_observe_obstacle is given: standard deviation of positions
   * per axis; root mean square of the obstacles' jerk at frequencies up to 1 Hz, per axis; the gap
   * after which the estimate of the motion starts again. 0: 0.002 m, 2 m/s^3, 0.5 s. */
  double observation_noise_m, observation_jerk_m_s3, observation_timeout_s;
  /* How far payloads that are attached later extend beyond the arm's reach, and how many shapes
   * they have together. 0: as the scene's events say. */
  double payload_reach_m;
  size_t payload_shapes_max;
  /* In place of scene_file, which is null then: the text of a scene. schema, robot, goals
   * and planner are required; everything else has the defaults of a scene file. Relative paths in
   * it start from scene_folder; null: the working directory. */
  const char *scene_json, *scene_folder;
  /* Bounds of single joints, one number or one per joint; null: those above. */
  const double* joint_acceleration_max; /* [rad/s^2 or m/s^2] */
  size_t joint_acceleration_max_count;
  const double* joint_jerk_max; /* [rad/s^3 or m/s^3] */
  size_t joint_jerk_max_count;
  /* Largest distance of an arm that is controlled by position from its set point [rad or m], one
   * number or one per joint; beyond it the arm is stopped. Null: 0.1. */
  const double* tracking_max;
  size_t tracking_max_count;
  double period_s;         /* between two ticks, at most 1; 0: that of the scene */
  size_t path_points_max;  /* of goals that are set later; 0: 256, or more if the scene has */
  int32_t no_certificate;  /* 1: the motion since the last tick is not examined */
  int32_t fixed_world;     /* 1: nothing will be added to the world */
  int32_t no_guide_thread; /* 1: hamelin_controller_run_guide searches the paths of a guide */
  double (*clock_s)(void); /* a clock in place of the computer's; also without late answers */
  double observation_noise_rad, observation_jerk_rad_s3; /* of rotations; 0: 0.01, 20 */
} hamelin_controller_options;

enum {
  HAMELIN_CONTROL_RUNNING = 0,
  HAMELIN_CONTROL_REACHED = 1, /* all goals were reached; the planner holds the last one */
  HAMELIN_CONTROL_STALLED = 2, /* by the scene's stall rule */
  HAMELIN_CONTROL_GAVE_UP = 3, /* by the planner's own judgement */
  /* The arm is brought to rest and held until hamelin_controller_resume or _reset. */
  HAMELIN_CONTROL_STOPPING = 4
};

/* Why an arm is stopped. */
enum {
  HAMELIN_STOP_NONE = 0,
  HAMELIN_STOP_PLANNER = 1,     /* it failed, or its torques are not finite */
  HAMELIN_STOP_LATE = 2,        /* too many of its answers in a row were late */
  HAMELIN_STOP_MEASUREMENT = 3, /* q, v or the time cannot be used */
  HAMELIN_STOP_TRACKING = 4,    /* the arm is too far from its set point */
  HAMELIN_STOP_REQUEST = 5      /* hamelin_controller_stop */
};

/* What is known of the motion between the last two ticks. */
enum {
  HAMELIN_VERDICT_NONE = 0,      /* it is not examined, or there was one tick only */
  HAMELIN_VERDICT_CERTIFIED = 1, /* it was proved clear, by margin_m at least */
  HAMELIN_VERDICT_OPEN = 2,      /* it was not proved clear */
  HAMELIN_VERDICT_CONTACT = 3    /* a clearance of zero or below was found */
};

/* Arrays have one number per joint, all finite, and stay valid until the next tick. */
typedef struct hamelin_answer {
  uint32_t struct_size;          /* set by the caller */
  int32_t state;                 /* HAMELIN_CONTROL_... */
  const char* cause;             /* why it gave up or stops; empty otherwise */
  const double* torque;          /* sum of all channels within the limits */
  const double *q_next, *v_next; /* one period ahead, for arms that are controlled by position */
  size_t goal_index;             /* the number of goals after the last one */
  uint64_t snapshot;             /* number of the world's snapshot that the answer is for */
  double clearance_m;            /* to obstacles; at most the planner's influence */
  int32_t certified;             /* 1: the motion since the last tick was proved clear */
  double margin_m;               /* by so much at least */
  int32_t saturated;             /* 1: a limit reduced the torque */
  uint64_t goals;                /* number of the list of goals: 0 for the scene's */
  double planner_s;              /* wall time that the planner took */
  uint64_t overruns;             /* in so many ticks it took longer than its deadline */
  uint64_t load;                 /* number of what the arm carries: 0 at first */
  uint64_t refused_load;         /* number of the last load that was refused; 0: none was */
  const char* load_refusal;      /* why; empty if none was */
  int32_t target;                /* HAMELIN_TARGET_..., where a target is followed */
  double target_position_m[3];   /* where it is */
  double target_error_m;         /* distance of the tip from it */
  int32_t reason;                /* HAMELIN_STOP_..., where it stops */
  int32_t shield_stopping;       /* 1: the shield refused the planner's answer and stops the arm */
  int32_t verdict;               /* HAMELIN_VERDICT_... */
  const double *reference_q, *reference_v; /* where a trajectory should be now; null without one */
  double tip_position_m[3], tip_quaternion_wxyz[4];
  const double* series; /* the planner's own figures, hamelin_controller_series_name; or NaN */
  size_t series_count;
  int32_t may_touch; /* 1: the current goal may touch something, which no proof regards */
} hamelin_answer;

enum {
  HAMELIN_TARGET_NONE = 0,     /* the goal does not follow a target */
  HAMELIN_TARGET_WAITING = 1,  /* nothing has arrived yet; the arm holds its place */
  HAMELIN_TARGET_FOLLOWED = 2, /* it is followed, if it is in reach */
  HAMELIN_TARGET_LOST = 3      /* the stream broke off, and the target rests */
};

/* Why the shield refuses a step: what the arm could touch or pass if it made the step and then
 * stopped. TORQUE: no stop within the torque limits exists. ANSWER: there is no usable answer. */
enum {
  HAMELIN_SHIELD_MAP = 0,
  HAMELIN_SHIELD_UNKNOWN_SPACE = 1,
  HAMELIN_SHIELD_OBSTACLE = 2,
  HAMELIN_SHIELD_SELF = 3,
  HAMELIN_SHIELD_JOINT_LIMIT = 4,
  HAMELIN_SHIELD_VELOCITY_LIMIT = 5,
  HAMELIN_SHIELD_TORQUE = 6,
  HAMELIN_SHIELD_ANSWER = 7
};

/* What is proved of obstacles that move. CLEAR: the arm stays clear of them as they are predicted.
 * AT_REST: those of which only the speed is bounded do not touch it before it rests. */
enum { HAMELIN_PROOF_CLEAR = 0, HAMELIN_PROOF_AT_REST = 1, HAMELIN_PROOF_NONE = 2 };

/* The shield and its counts since the start, hamelin_controller_create or _reset. */
typedef struct hamelin_shield {
  uint32_t struct_size;  /* set by the caller */
  int32_t active;        /* 0: the controller has no shield, and all else is 0 */
  int32_t stopping;      /* 1: it refused the last step */
  int32_t cause;         /* HAMELIN_SHIELD_... of the last step; -1: it was accepted */
  const char* line;      /* what was in the way then, or empty; valid until the next call */
  int32_t proof;         /* HAMELIN_PROOF_... after the last step; -1: nothing that moves is near */
  int32_t strayed_joint; /* whose strayed_share that is, from 0; -1: none strayed */
  int64_t steps, refused; /* that were asked for, and of them those that were refused */
  int64_t at_rest;        /* refused while the arm rested */
  int64_t stops, longest; /* runs of refused steps, and the longest of them in steps */
  int64_t causes[8];      /* of the stops' beginnings, by HAMELIN_SHIELD_... */
  double strayed;         /* largest deviation of a joint from a stop's motion [rad or m] */
  double strayed_share;   /* the same as a share of the bound that the margins cover */
  int64_t overtaken;      /* stops that continued after the world had changed in their way */
  int64_t evasions;       /* stops that were followed by a move out of the way */
  int64_t proofs[3];      /* steps with moving obstacles in reach, by HAMELIN_PROOF_... */
} hamelin_shield;

/* What the scene's guide did since the start. */
typedef struct hamelin_guide {
  uint32_t struct_size; /* set by the caller */
  int32_t active;       /* 0: the scene has no guide, and all else is 0 */
  int64_t searches, found;
  int64_t kept;    /* paths that were still clear after a change of the world */
  int64_t checks;  /* of all searches */
  double waited_s; /* for which the arm held its place */
  double length;   /* of the last path [rad or m] */
} hamelin_guide;

enum { HAMELIN_SPHERE = 0, HAMELIN_BOX = 1, HAMELIN_CYLINDER = 2, HAMELIN_CAPSULE = 3 };

/* What is known of an obstacle's future besides its present pose and motion: it goes on with the
 * present velocity and acceleration, or with the present velocity; or nothing but that no point of
 * it is faster than speed_max_m_s. */
enum { HAMELIN_CONSTANT_ACCELERATION = 0, HAMELIN_CONSTANT_VELOCITY = 1, HAMELIN_SPEED_BOUND = 2 };

typedef struct hamelin_obstacle {
  uint32_t struct_size;
  const char* name; /* an obstacle of the same name is replaced */
  int32_t shape;
  double radius_m;  /* sphere, cylinder, capsule */
  double length_m;  /* cylinder, capsule without its caps; along the z axis */
  double size_m[3]; /* box: full edges */
  double position_m[3], quaternion_wxyz[4];
  int32_t prediction;   /* one of the enumeration above */
  double speed_max_m_s; /* of any point of it; 0: not stated. Observed poses may not jump faster */
} hamelin_obstacle;

/* A body that is fixed to the tip. All coordinates are in the tip's frame. */
typedef struct hamelin_payload_capsule {
  double from_m[3], to_m[3]; /* a sphere if both are equal */
  double radius_m;
} hamelin_payload_capsule;

typedef struct hamelin_payload {
  uint32_t struct_size;
  const char* name;
  double mass_kg;
  double position_m[3];    /* centre of mass */
  double inertia_kg_m2[6]; /* xx, yy, zz, xy, xz, yz about the centre of mass */
  const hamelin_payload_capsule* shapes;
  size_t shape_count;
} hamelin_payload;

/* A measured pose of an obstacle or a target. Pointers to three numbers may be null: then the
 * velocity, the acceleration or the angular velocity [rad/s] is estimated from the poses. */
typedef struct hamelin_observation {
  uint32_t struct_size;
  double time_s; /* of the measurement, on the clock of hamelin_controller_tick */
  double position_m[3], quaternion_wxyz[4];
  const double *velocity_m_s, *acceleration_m_s2, *angular_velocity_rad_s;
} hamelin_observation;

/* What carries a depth sensor. */
enum {
  HAMELIN_MOUNT_WORLD = 0,
  HAMELIN_MOUNT_BASE = 1,
  HAMELIN_MOUNT_TIP = 2,
  HAMELIN_MOUNT_FRAME = 3
};

/* What a depth sensor saw at one time. */
typedef struct hamelin_point_frame {
  uint32_t struct_size;
  int32_t mount;         /* HAMELIN_MOUNT_... */
  int32_t source;        /* the same for all frames of a sensor, another for each sensor */
  const float* points_m; /* x, y, z of each in the sensor's frame, finite */
  size_t points;         /* 1 to 2000000 */
  double position_m[3], quaternion_wxyz[4]; /* of the sensor, in the frame of its mount */
  double time_s;     /* when they were seen, on the clock of hamelin_controller_tick */
  double range_m;    /* of points that are farther only the way up to there is free; 0: no bound */
  const char* frame; /* HAMELIN_MOUNT_FRAME: name of a link or fixed frame of the robot */
} hamelin_point_frame;

/* What a frame changed. */
typedef struct hamelin_frame_report {
  uint32_t struct_size;          /* set by the caller */
  uint64_t snapshot;             /* the first that knows the frame */
  uint64_t points;               /* that were used */
  uint64_t on_arm, on_obstacles; /* points that were left out */
  uint64_t movers;               /* bodies that move, which it sees */
  uint64_t occupied, cleared;    /* voxels of the map */
} hamelin_frame_report;

/* Returns null on failure. */
hamelin_controller* hamelin_controller_create(const hamelin_controller_options* options,
                                              char* error, size_t error_size);
void hamelin_controller_destroy(hamelin_controller* controller);          /* null is allowed */
size_t hamelin_controller_dof(const hamelin_controller* controller);      /* 0 for null */
double hamelin_controller_period_s(const hamelin_controller* controller); /* 0 for null */
/* Time that the planner should not exceed in a tick [s]; 0 for null. */
double hamelin_controller_deadline_s(const hamelin_controller* controller);
/* The name of a number of hamelin_answer.series; null beyond the last one. Valid until the load
 * changes or the arm resumes. For the thread of hamelin_controller_tick. */
const char* hamelin_controller_series_name(const hamelin_controller* controller, size_t index);

/* q and v: measured joint positions and velocities. Times do not fall. Fails if the arm cannot
 * begin: the first measurement cannot be used, or the arm could not stop where it is. Then the
 * state is HAMELIN_CONTROL_STOPPING, cause says why, and torque, q_next and v_next are null: send
 * nothing to the arm. */
int32_t hamelin_controller_tick(hamelin_controller* controller, double time_s, const double* q,
                                const double* v, hamelin_answer* answer);
/* A new start, for instance after the arm was guided by hand: the next ticks are those of a
 * controller that was just made, with the goals, parameters, load and world that are in force. For
 * the thread of hamelin_controller_tick; this takes milliseconds. */
int32_t hamelin_controller_reset(hamelin_controller* controller, char* error, size_t error_size);
/* Brings the arm to rest from the next tick on, and holds it; by any thread. cause: one line for
 * hamelin_answer.cause, which has its first 511 bytes. */
int32_t hamelin_controller_stop(hamelin_controller* controller, const char* cause, char* error,
                                size_t error_size);
/* After any stop: resumes from the measured position, from the next tick on, with the same goal as
 * before; by any thread. It has no effect unless the last answer has the state
 * HAMELIN_CONTROL_STOPPING. The arm remains stopped, and hamelin_answer.cause says why, if the
 * measurement of that tick cannot be used or the arm could not stop from where it is. This takes
 * milliseconds. */
int32_t hamelin_controller_resume(hamelin_controller* controller, char* error, size_t error_size);

/* For the thread of hamelin_controller_tick, between two ticks; they do not allocate. */
int32_t hamelin_controller_shield(hamelin_controller* controller, hamelin_shield* shield,
                                  char* error, size_t error_size);
int32_t hamelin_controller_guide(hamelin_controller* controller, hamelin_guide* guide, char* error,
                                 size_t error_size);
/* With no_guide_thread: searches the path that the last tick has asked for, if it did. For the
 * thread of hamelin_controller_tick, between two ticks; this allocates. */
int32_t hamelin_controller_run_guide(hamelin_controller* controller, char* error,
                                     size_t error_size);

/* What is believed of a stream of targets, see scene::TargetStream. 0 selects the default. */
typedef struct hamelin_target_stream {
  uint32_t struct_size;
  int32_t position_only;           /* 1: any orientation will do */
  double gap_max_s;                /* after a longer gap the target is lost; 0.2 */
  double jump_max_m, jump_max_rad; /* from where the target is expected; 0.1, 0.5 */
  double noise_m, noise_rad;       /* standard deviation of poses, per axis; 0.0005, 0.002 */
  double leash_m, leash_rad;       /* of targets that are moved by twists; 0.05, 0.3 */
} hamelin_target_stream;

/* The goals, from the next tick on, to be reached in this order; by any thread. goals_json: a list
 * as /goals of a scene, or a single goal. */
int32_t hamelin_controller_set_goals(hamelin_controller* controller, const char* goals_json,
                                     const char* folder, uint64_t* number, char* error,
                                     size_t error_size);
/* The goals, replaced by one, from the next tick on; by any thread. *number, unless null, receives
 * what hamelin_answer.goals will be. Tolerances of 0 select the defaults of scene files. */
int32_t hamelin_controller_set_joint_goal(hamelin_controller* controller, const double* q,
                                          double tolerance_rad, uint64_t* number, char* error,
                                          size_t error_size);
/* Of the tip; without quaternion_wxyz (null) only its position counts. */
int32_t hamelin_controller_set_pose_goal(hamelin_controller* controller, const double position_m[3],
                                         const double quaternion_wxyz[4], double tolerance_m,
                                         double tolerance_rad, uint64_t* number, char* error,
                                         size_t error_size);
/* A motion over time: `points` times in s, the first 0, and at each of them dof positions,
 * velocities and accelerations, point by point; accelerations may be null. The arm must follow it
 * in time and waits nowhere else than where it is held up. The planner must be one that follows
 * trajectories, such as hybrid. */
int32_t hamelin_controller_set_trajectory(hamelin_controller* controller, const double* time_s,
                                          const double* q, const double* v, const double* a,
                                          size_t points, double tolerance_rad, uint64_t* number,
                                          char* error, size_t error_size);
/* A goal that follows a target, until another goal is set. The planner must be one that follows
 * targets, such as hybrid. stream may be null. */
int32_t hamelin_controller_follow(hamelin_controller* controller,
                                  const hamelin_target_stream* stream, uint64_t* number,
                                  char* error, size_t error_size);
/* Moves that target, from the next tick on; by any thread: to a pose, from where it goes on with
 * the velocities that are given or estimated, or with a twist in the axes of the world, as of a
 * joystick. Times must increase. Fails for numbers that are not finite and poses that jump; the
 * target stays as it was then. */
int32_t hamelin_controller_set_target(hamelin_controller* controller,
                                      const hamelin_observation* pose, char* error,
                                      size_t error_size);
int32_t hamelin_controller_set_target_twist(hamelin_controller* controller, double time_s,
                                            const double velocity_m_s[3],
                                            const double angular_velocity_rad_s[3], char* error,
                                            size_t error_size);
/* Changes parameters of the planner, from the next tick on; by any thread. params_json: an object
 * with those that change. */
int32_t hamelin_controller_set_planner_params(hamelin_controller* controller,
                                              const char* params_json, char* error,
                                              size_t error_size);
/* Writes all parameters of the planner, as last set, as a JSON object to `json` (json_size bytes,
 * nul-terminated). *needed, unless null, receives how many bytes that takes. Fails if json_size is
 * smaller; json may be null if json_size is 0. Any thread. */
int32_t hamelin_controller_planner_params(hamelin_controller* controller, char* json,
                                          size_t json_size, size_t* needed, char* error,
                                          size_t error_size);

/* Fixes a body to the tip, or takes it off again, from the next tick on; by any thread. q: the
 * configuration in which this happens; parts of the arm that the body touches there may go on to
 * touch it. *load, unless null, receives what hamelin_answer.load will be, unless the tick refuses
 * the body, because it is in contact or the arm could not stop with it. This takes milliseconds. */
int32_t hamelin_controller_attach(hamelin_controller* controller, const hamelin_payload* payload,
                                  const double* q, uint64_t* load, char* error, size_t error_size);
int32_t hamelin_controller_detach(hamelin_controller* controller, const char* name, const double* q,
                                  uint64_t* load, char* error, size_t error_size);
/* Writes the names of what is attached, or will be at the next tick, as a JSON list of strings; see
 * hamelin_controller_planner_params. Any thread. */
int32_t hamelin_controller_attached(hamelin_controller* controller, char* json, size_t json_size,
                                    size_t* needed, char* error, size_t error_size);

/* Changes of the world. *snapshot, unless null, receives the number of the first snapshot that
 * contains the change. */
int32_t hamelin_controller_set_obstacle(hamelin_controller* controller,
                                        const hamelin_obstacle* obstacle, uint64_t* snapshot,
                                        char* error, size_t error_size);
/* At time_s the obstacle is at the pose, from where it moves on with the velocity. */
int32_t hamelin_controller_move_obstacle(hamelin_controller* controller, const char* name,
                                         const double position_m[3],
                                         const double quaternion_wxyz[4],
                                         const double velocity_m_s[3], double time_s,
                                         uint64_t* snapshot, char* error, size_t error_size);
/* Takes a pose of a stream, from where the obstacle moves on with what is given or estimated; see
 * World::observe_obstacle. Times must increase. */
int32_t hamelin_controller_observe_obstacle(hamelin_controller* controller, const char* name,
                                            const hamelin_observation* observation,
                                            uint64_t* snapshot, char* error, size_t error_size);
/* *time_s receives the time of the last observation or move of the obstacle, or minus infinity. A
 * stream that ends does not stop the obstacle. */
int32_t hamelin_controller_last_observed(hamelin_controller* controller, const char* name,
                                         double* time_s, char* error, size_t error_size);
int32_t hamelin_controller_remove_obstacle(hamelin_controller* controller, const char* name,
                                           uint64_t* snapshot, char* error, size_t error_size);
/* Replaces the map by an OctoMap file (.bt, .ot) whose frame is the world; null removes it. */
int32_t hamelin_controller_set_map(hamelin_controller* controller, const char* file,
                                   uint64_t* snapshot, char* error, size_t error_size);
/* The same with all that /map of a scene has: pose, scale, unknown space, self-filter. Changes that
 * it lists are not made. map_json null or "null": removes the map. q: the configuration in which a
 * self-filter finds the arm; null: the scene's start. */
int32_t hamelin_controller_set_map_json(hamelin_controller* controller, const char* map_json,
                                        const char* folder, const double* q, uint64_t* snapshot,
                                        char* error, size_t error_size);
/* Makes what a depth sensor saw part of the map: points on the arm, its load or a known obstacle
 * are left out, and rays to the others free what they pass; see World::insert_points. report may be
 * null. Takes some 0.1 s for 320 x 240 points. */
int32_t hamelin_controller_insert_points(hamelin_controller* controller,
                                         const hamelin_point_frame* frame,
                                         hamelin_frame_report* report, char* error,
                                         size_t error_size);
/* Frees and occupies voxels of the map now: an object as in /map/changes of a scene, whose time_s
 * may be left out and is not used. */
int32_t hamelin_controller_change_map(hamelin_controller* controller, const char* change_json,
                                      const char* folder, uint64_t* snapshot, char* error,
                                      size_t error_size);

#ifdef __cplusplus
}
#endif
#endif
