#ifndef HAMELIN_PLANNING_PLUGIN_ABI_H
#define HAMELIN_PLANNING_PLUGIN_ABI_H
/*
 * The interface between hamelin and a planner plugin. It uses C types only, so a plugin may be
 * built by another compiler, with other flags and another Eigen. All quantities are in SI units and
 * radians, as 64-bit floating-point numbers. Unless stated otherwise, pointers are valid only
 * during the call, and all calls of one planner come from one thread.
 *
 * Growth. Host and plugin each state the oldest and the newest version of the interface that they
 * support; they work together if these ranges overlap, by the newest version in both. Within a
 * version, fields are only appended to structs:
 *  - A struct that is passed by pointer begins with its size in bytes. HAMELIN_HAS_FIELD says
 *    whether the other side's struct has a field that was appended later.
 *  - Arrays of structs are a pointer, a count and a stride: the distance of two elements in bytes,
 *    which is the size of the element for the side that owns the memory. Step by the stride, never
 *    by sizeof; HAMELIN_ELEMENT does so.
 *
 * Frames: "world" is the scene's frame; "link" is the frame at a link's centre of mass, as in the
 * robot JSON.
 */
#include <stddef.h>
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif

/* The newest and the oldest version that code built with this header supports. */
#define HAMELIN_PLUGIN_ABI_VERSION 4u
#define HAMELIN_PLUGIN_ABI_VERSION_MIN 4u
#define HAMELIN_PLUGIN_ENTRY_NAME "hamelin_plugin_entry"

/* Whether *pointer, a struct of this type from the other side, has the field. */
#define HAMELIN_HAS_FIELD(pointer, type, field) \
  ((pointer)->struct_size >= offsetof(type, field) + sizeof((pointer)->field))
/* The same for the elements of an array with this stride. */
#define HAMELIN_ELEMENT_HAS_FIELD(array, stride, type, field) \
  ((stride) >= offsetof(type, field) + sizeof((array)->field))
/* Pointer to an element of an array of structs. */
#define HAMELIN_ELEMENT(type, array, stride, index) \
  ((const type*)(const void*)((const char*)(array) + (size_t)(index) * (size_t)(stride)))

/* A control shape: a part of the arm from which distances to obstacles are measured. It is a
 * sphere, or a capsule, which is a sphere swept along its axis from center - half_axis to center +
 * half_axis. hamelin_setup lists all shapes, link by link, the spheres of a link first. */
typedef struct hamelin_shape {
  int32_t link;          /* index of the moving link, 0 .. dof - 1 */
  int32_t index_in_link; /* in the link's "spheres" of the JSON; for a capsule in "segments" */
  double center_link_m[3];
  double radius_m;
  double half_axis_link_m[3]; /* zero for a sphere */
} hamelin_shape;

/* What a contact is with: the occupied space of the map, space that the map does not know (in
 * scenes where it blocks), or else the id of an obstacle. An obstacle keeps its id for its life,
 * and ids are not used again. */
#define HAMELIN_OBSTACLE_MAP (-1)
#define HAMELIN_OBSTACLE_UNKNOWN (-2)

/* One near obstacle point of one control shape. For a capsule, the nearest point of its axis takes
 * the role of a sphere's centre; a capsule along a wall has further contacts at other points of its
 * axis. */
typedef struct hamelin_contact {
  int32_t shape;               /* index into hamelin_setup.shapes */
  int32_t obstacle;            /* HAMELIN_OBSTACLE_MAP, _UNKNOWN, or the obstacle's id */
  double distance_m;           /* from the shape's surface; zero or less means contact */
  double arm_point_world_m[3]; /* on the shape's surface */
  double obstacle_point_world_m[3];
  double direction_world[3]; /* unit, from the obstacle to the shape: gradient of the distance */
  double obstacle_velocity_world_m_s[3];
} hamelin_contact;

/* The base, in place of the index of a shape: a part of the arm that does not move. */
#define HAMELIN_SHAPE_OF_BASE (-1)

/* A near pair of control shapes of the arm itself: the nearest pair of two parts that may touch.
 * Such pairs are listed if the scene models self-collision. */
typedef struct hamelin_self_contact {
  int32_t shape_a, shape_b; /* index into hamelin_setup.shapes; b also HAMELIN_SHAPE_OF_BASE */
  double distance_m;        /* between the surfaces; zero or less means contact */
  double point_a_world_m[3], point_b_world_m[3]; /* on the surfaces */
  double direction_world[3];                     /* unit, from b towards a */
} hamelin_self_contact;

enum {
  HAMELIN_OBSTACLE_SPHERE = 0,
  HAMELIN_OBSTACLE_BOX = 1,
  HAMELIN_OBSTACLE_CYLINDER = 2,
  HAMELIN_OBSTACLE_CAPSULE = 3
};

/* What is known of an obstacle's future: its path; that it keeps its acceleration, or its velocity,
 * as far as anybody knows; or a bound of its speed only. */
enum {
  HAMELIN_PREDICTION_PATH = 0,
  HAMELIN_PREDICTION_ACCELERATION = 1,
  HAMELIN_PREDICTION_VELOCITY = 2,
  HAMELIN_PREDICTION_SPEED_BOUND = 3
};

/* An obstacle at some time. */
typedef struct hamelin_obstacle_state {
  int32_t id;                                     /* as in hamelin_contact.obstacle */
  int32_t shape;                                  /* HAMELIN_OBSTACLE_SPHERE, ... */
  const char* name;                               /* unique among the obstacles */
  double radius_m;                                /* sphere, cylinder, capsule */
  double length_m;                                /* along z; of a capsule, without its caps */
  double size_m[3];                               /* box: full edges */
  double position_world_m[3], quaternion_wxyz[4]; /* of its centre and axes */
  double velocity_world_m_s[3];                   /* of its centre */
  /* Appended in version 4. */
  double acceleration_world_m_s2[3]; /* of its centre */
  double angular_velocity_world_rad_s[3];
  int32_t moves;        /* 1: it moves, or may move later */
  int32_t prediction;   /* HAMELIN_PREDICTION_PATH, ... */
  double speed_max_m_s; /* of any point of it, where the prediction is a bound; else 0 */
  double nearer_m;      /* by how much it may have come nearer than this pose by that time */
} hamelin_obstacle_state;

/* A box of occupied space. Boxes of a map are disjoint. */
typedef struct hamelin_box {
  int32_t obstacle; /* HAMELIN_OBSTACLE_MAP or _UNKNOWN */
  double center_world_m[3], half_size_m[3];
  double quaternion_wxyz[4]; /* orientation: the same for all boxes of a map */
} hamelin_box;

/* FOLLOW: a target that moves, which the tip follows until the run ends. Only planners with the
 * property HAMELIN_FOLLOWS_TARGETS get such goals. */
enum {
  HAMELIN_GOAL_JOINT = 0,
  HAMELIN_GOAL_POSITION = 1,
  HAMELIN_GOAL_POSE = 2,
  HAMELIN_GOAL_FOLLOW = 3
};

/* What is known of a path to a goal: nobody has asked for one; it is being searched; it is there;
 * none was found. */
enum {
  HAMELIN_PATH_NOT_SOUGHT = 0,
  HAMELIN_PATH_SOUGHT = 1,
  HAMELIN_PATH_FOUND = 2,
  HAMELIN_PATH_NOT_FOUND = 3
};

typedef struct hamelin_goal {
  uint32_t struct_size;
  int32_t type;
  double position_world_m[3]; /* position, pose and follow goals: desired position of the tip */
  double quaternion_wxyz[4];  /* pose and follow goals: desired orientation of the tip */
  const double* q;            /* joint goals: dof numbers; else null */
  double tolerance_m, tolerance_rad, speed_max;
  /* A joint goal may be the end of a path of joint vectors, of which the goal's q is the last. The
   * path is a guide; only its end must be reached. Null and 0 without a path. */
  const double* path; /* path_points * dof numbers, point by point */
  size_t path_points; /* at most hamelin_setup.path_points_max */
  /* Appended in version 4. */
  /* Follow goals: position and orientation above are those of the target at the time of the tick,
   * and below are their derivatives, as far as they are known. All of these change from tick to
   * tick while the goal keeps its goal_number. */
  int32_t follows_rotation; /* 1: position and orientation; 0: any orientation will do */
  int32_t target_lost;      /* 1: the stream of targets broke off, and the target rests */
  double velocity_world_m_s[3], acceleration_world_m_s2[3];
  double angular_velocity_world_rad_s[3], angular_acceleration_world_rad_s2[3];
  /* Joint goals with a trajectory, whose points are the path: where the arm should be at the time
   * of the tick, dof numbers each [rad or m, and per s and s^2]; else null. They change from tick
   * to tick while the goal keeps its goal_number. Only planners with the property
   * HAMELIN_FOLLOWS_TRAJECTORIES get such goals. */
  const double *reference_q, *reference_v, *reference_a;
  double reference_time_s; /* on the clock of the trajectory */
  /* How fast that clock runs: 1, or less while the arm is held up, down to 0. It is contained in
   * reference_v and reference_a. */
  double reference_rate;
  /* HAMELIN_PATH_NOT_SOUGHT, ...: see hamelin_host.request_path. */
  int32_t path_search;
  /* The clearance that a path which was searched keeps away from its ends [m]; 0: not known. */
  double path_margin_m;
  /* 1: the motion of the reference is proved to be clear, and the shield can stop along it: an arm
   * that stays close to it needs no other margin. */
  int32_t reference_certified;
} hamelin_goal;

/* A gyroscopic term: the force w x (velocity of the point) acts at a point of a link. It does no
 * work. */
typedef struct hamelin_gyroscopic_term {
  int32_t link;
  double point_link_m[3];
  double w_world[3]; /* [N s/m] */
} hamelin_gyroscopic_term;

/* The data that are fixed for a whole run, passed to create. Strings and arrays stay valid until
 * destroy. */
typedef struct hamelin_setup {
  uint32_t struct_size;
  size_t dof;
  const char* robot_json; /* the nominal robot, hamelin.robot/1, without gravity and base */
  size_t robot_json_size;
  double gravity_world_m_s2[3];
  double base_position_world_m[3]; /* pose of the robot's base frame */
  double base_quaternion_wxyz[4];
  const hamelin_shape* shapes;
  size_t shape_count, shape_stride;
  /* The goals at the start, in the order in which they must be reached. Others may replace them
   * while the planner runs: hamelin_tick.goal is the one that counts. */
  const hamelin_goal* goals;
  size_t goal_count, goal_stride;
  size_t path_points_max; /* no goal, also of later ones, has a longer path */
  /* Limits: dof numbers each, or null if the scene does not model them. Unlimited joints have
   * +-infinity. */
  const double *q_lower, *q_upper, *velocity_max, *effort_max;
  const double* effort_rate_max; /* rate of the torque [Nm/s or N/s], sampled actuation only */
  double control_period_s;       /* time between two ticks */
  double deadline_s;             /* time within which a tick should be answered */
  int32_t sampled; /* 0: channels act separately; 1: summed into one torque per control_period_s */
  int32_t self_collision;  /* 1: ticks list self contacts */
  double delay_s;          /* under sampled actuation: the delay until that torque acts */
  double influence_m;      /* ticks list contacts up to this distance */
  double map_resolution_m; /* edge of the map's smallest box; zero without a map */
  uint64_t seed;
  /* The instruction set of the host's kernels: "x86-64", "v3", "v4" or "generic". A plugin that
   * links hamelin's libraries has its own copy of them and should use the same set. */
  const char* instruction_set;
  /* A shield refuses steps that come nearer than this to obstacles, or bring parts of the arm
   * nearer to each other [m]. It keeps more where the arm moves fast. Zero without a shield. */
  double shield_margin_m, shield_self_margin_m;
} hamelin_setup;

/* The input of one tick. Where something is attached to the arm or detached from it, this planner
 * is replaced by another one, which was created for the arm as it is then. */
typedef struct hamelin_tick {
  uint32_t struct_size;
  uint64_t k;
  double time_s;
  const double *q, *v;             /* dof numbers each */
  const hamelin_contact* contacts; /* ordered by shape, then by distance */
  size_t contact_count, contact_stride;
  const hamelin_self_contact* self_contacts; /* ordered by pair of parts, up to influence_m */
  size_t self_contact_count, self_contact_stride;
  /* The current goal. It stays valid until a tick has another goal_number, which is the case
   * whenever the goal is another one: the next of the list, or the first of a new list. */
  const hamelin_goal* goal;
  uint64_t goal_number;
  size_t goal_index;  /* of the goal in its list */
  uint64_t world;     /* number of the world's snapshot: changes with obstacles and map */
  double speed_scale; /* 1, or less in unknown space if the scene's policy is "slow" */
  /* The joint torques sent to the arm last [Nm or N], within all limits and not the planner's where
   * a shield stopped the arm; where positions are sent, the torque of the set point: dof numbers;
   * null under ideal actuation. */
  const double* torque;
  /* Appended in version 4. */
  size_t moving_count; /* obstacles that move, or may move later, however far they are */
  /* The joint accelerations that the model does not explain, because of friction or wrong masses,
   * as the controller estimates them [rad/s^2 or m/s^2]: dof numbers; null where no torques are
   * sent. They are those of the arm, whatever a shield did with the planner's torques. */
  const double* disturbance;
  /* What the tip keeps on the way to the goal, to first order: what is left of each tolerance, but
   * for a reserve [rad or m], negative beyond that, and its derivative by q, dof numbers each. A
   * path to the goal keeps them; a planner that leaves it should. */
  size_t kept_count;
  const double *kept_slack, *kept_gradient;
} hamelin_tick;

/* DETECTS_STALLS: running, and the planner detects its stalls itself: the scene's stall rule is
 * disabled. */
enum {
  HAMELIN_PLANNER_RUNNING = 0,
  HAMELIN_PLANNER_GAVE_UP = 1,
  HAMELIN_PLANNER_DETECTS_STALLS = 2
};

/*
 * The answer of one tick, in channels. The host owns the memory and clears it before each call;
 * channels that are not set have no effect.
 *  potential      value and gradient at q, applied as half-kicks at both nodes of the step
 *  damping        torque -damping_i v_i, coefficients kept over the step
 *  gyroscopic     gyroscopic terms, coefficients kept over the step
 *  held torque    torque that is constant over the step
 *  node velocity  velocity right after this node, for instance projected by a safety filter
 */
typedef struct hamelin_command {
  uint32_t struct_size;
  int32_t state;   /* HAMELIN_PLANNER_RUNNING, ... */
  char cause[128]; /* with GAVE_UP: the reason, one line, nul-terminated */
  double potential_J;
  double* potential_gradient;          /* dof */
  double* damping;                     /* dof, non-negative */
  hamelin_gyroscopic_term* gyroscopic; /* gyroscopic_capacity terms, at least one per contact */
  size_t gyroscopic_capacity, gyroscopic_count, gyroscopic_stride;
  double* held_torque;   /* dof */
  double* node_velocity; /* dof */
  int32_t has_node_velocity;
  /* The planner's own accounts for the log: energy removed (negative) or added at this node. */
  double filter_work_J;   /* by constraints that admit rest: never above zero */
  double recovery_work_J; /* by constraints that demand motion, as inside a margin */
  /* One number for each series that was declared at create, in that order. Series that are not set
   * are NaN, and null in the log. */
  double* series;
  size_t series_count;
} hamelin_command;

enum { HAMELIN_LOG_INFO = 0, HAMELIN_LOG_WARNING = 1 };

/* Kinds of obstacles, to be added up: those that never move, with the map; those that may. */
enum { HAMELIN_STANDING = 1, HAMELIN_MOVING = 2 };

/* A handle for questions about the world at any configuration, from any thread. One thread at a
 * time may use a handle; several handles work in parallel. A handle sees the snapshot of the world
 * and counts from the time of the last tick, both of the last query_refresh: so a series of answers
 * is consistent. Only open, refresh and boxes allocate. */
typedef struct hamelin_query hamelin_query;

/*
 * Services of the host, valid until destroy. The functions whose comments say [tick] may be called
 * inside create, tick, reset, apply_params and world_changed only, on the thread of that call; all
 * others on any thread until destroy returns.
 *
 * Functions with `out, capacity, stride` write up to `capacity` structs at the caller's stride,
 * which is the size of its own struct, and return how many there are; if there are more than
 * capacity, the farthest are left out.
 */
typedef struct hamelin_host {
  uint32_t struct_size;
  uint32_t abi_version, abi_version_min; /* the newest and oldest version that the host supports */
  void* context;
  /* [tick] Writes one line to the log; the text is not nul-terminated. */
  void (*log)(void* context, int32_t level, const char* text, size_t size);
  /* [tick] Finds the contacts of the control shapes at any q, up to `influence_m`, with the
   * obstacles at their present positions. */
  size_t (*closest_points)(void* context, const double* q, double influence_m, hamelin_contact* out,
                           size_t capacity, size_t stride);
  /* [tick] Finds the self contacts at any q, in the same way. */
  size_t (*closest_self)(void* context, const double* q, double influence_m,
                         hamelin_self_contact* out, size_t capacity, size_t stride);
  /* [tick] Lists the obstacles that the planner is shown, at their present positions. Names stay
   * valid during the call of the planner. */
  size_t (*obstacles)(void* context, hamelin_obstacle_state* out, size_t capacity, size_t stride);
  /* [inside create only] Declares a series of numbers, one per tick, for log and report. Name and
   * unit are nul-terminated; the unit may be empty. Returns the index into hamelin_command.series,
   * or -1 if the name is empty or in use. */
  int32_t (*declare_series)(void* context, const char* name, const char* unit);

  /* Makes a handle and refreshes it. Null if memory is missing. The planner closes its handles
   * before destroy returns. */
  hamelin_query* (*open_query)(void* context);
  void (*close_query)(hamelin_query* query);
  /* Takes the newest snapshot of the world and the time of the last tick. Writes the snapshot's
   * number and that time [s]; both pointers may be null. Returns 0; nonzero if memory is missing:
   * the handle keeps what it had. It may wait shortly for a thread that changes the world, so do
   * not call it in a tick that must not wait. */
  int32_t (*query_refresh)(hamelin_query* query, uint64_t* world, double* time_s);
  /* Writes the clearance of `count` configurations, one after the other in q: the smallest distance
   * of any shape from obstacles (where they will be time_ahead_s after the time of the handle, by
   * what is known of their future) and, if the scene models it, of the arm from itself. Distances
   * above hamelin_setup.influence_m count as this. Once it is below `at_least`, a configuration is
   * not examined further, and what is written is an upper bound below `at_least`. */
  void (*query_clearance)(hamelin_query* query, const double* q, size_t count, double time_ahead_s,
                          double at_least_m, double* out);
  size_t (*query_contacts)(hamelin_query* query, const double* q, double time_ahead_s,
                           double influence_m, hamelin_contact* out, size_t capacity,
                           size_t stride);
  size_t (*query_self_contacts)(hamelin_query* query, const double* q, double influence_m,
                                hamelin_self_contact* out, size_t capacity, size_t stride);
  /* Whether the motion on the straight line in joint space from q0 to q1, at constant speed between
   * the times t0_s and t1_s after the time of the handle, is proved clear of moving obstacles and
   * of the arm itself, docs/theory.md chapter 12. Returns 1 if it is; 0 for contact, or if there is
   * no proof. margin_m, unless null, receives a lower bound of all distances if it is. */
  int32_t (*query_motion_clear)(hamelin_query* query, const double* q0, const double* q1,
                                double t0_s, double t1_s, double* margin_m);
  /* Distances of `count` points in the world (three numbers each) from the nearest obstacle, with
   * their gradients (three numbers each, or null): unit vectors away from it. Beyond limit_m the
   * distance is limit_m and the gradient zero. The map is known within the arm's reach plus
   * hamelin_setup.influence_m only. */
  void (*query_distance)(hamelin_query* query, const double* points_world_m, size_t count,
                         double time_ahead_s, double limit_m, double* distance_m, double* gradient);
  /* Lists the map's boxes that meet the axis-aligned region from low to high of the world; with a
   * rotated map also some close by. Boxes of unknown space are listed where it blocks. */
  size_t (*query_boxes)(hamelin_query* query, const double low_world_m[3],
                        const double high_world_m[3], hamelin_box* out, size_t capacity,
                        size_t stride);
  /* Lists the obstacles as they will be. Names stay valid until the next refresh. */
  size_t (*query_obstacles)(hamelin_query* query, double time_ahead_s, hamelin_obstacle_state* out,
                            size_t capacity, size_t stride);

  /* Appended in version 4. */

  /* [tick] Finds contacts at any q like closest_points, with obstacles of some kinds only
   * (HAMELIN_STANDING, HAMELIN_MOVING or their sum), where they will be time_ahead_s from now by
   * what is known of their future. Distances from an obstacle of which only the speed is bounded
   * are less by what it may have moved. Moving obstacles are found at any distance up to
   * influence_m, the others up to hamelin_setup.influence_m. Several calls in a row with equal q
   * cost less. */
  size_t (*closest_ahead)(void* context, const double* q, double time_ahead_s, int32_t kinds,
                          double influence_m, hamelin_contact* out, size_t capacity, size_t stride);
  /* [tick] Lists obstacles of some kinds where they will be time_ahead_s from now, like
   * obstacles(). For one tick, the order is always the same. */
  size_t (*obstacles_ahead)(void* context, double time_ahead_s, int32_t kinds,
                            hamelin_obstacle_state* out, size_t capacity, size_t stride);
  /* [tick, inside tick only] Draws a line of `count` points of the world (three numbers each) for
   * log and report, such as the path of the tip that the planner considers. The lines of a tick
   * are drawn together, until a later tick draws others. */
  void (*draw_path)(void* context, const double* points_world_m, size_t count);
  /* [tick, inside tick only] Asks for a collision-free path to the current goal. Returns 1 if it
   * will be searched, and 0 if there is no search or it has been asked too often at this goal. If
   * it is 1, later ticks have another goal in place of the current one: at first a joint goal where
   * the arm is, so that it waits there; then a joint goal with the path, or the goal itself if none
   * was found. hamelin_goal.path_search says which. A goal that follows a target stays, and its
   * path leads to where the target was. Paths follow the map: where it changes, what is left of a
   * path is proved again, or searched again. Only planners with the property HAMELIN_ASKS_FOR_PATHS
   * may ask. */
  int32_t (*request_path)(void* context);
} hamelin_host;

/* An arm is on its reference if no joint is farther from it than this [rad or m]. */
#define HAMELIN_ON_PATH 0.1

/* hamelin_plugin.properties: what a planner does not promise, and what it can do besides. */
enum {
  HAMELIN_TICK_ALLOCATES = 1,  /* its tick may use the heap, and so may wait for other threads */
  HAMELIN_USES_THREADS = 2,    /* it starts threads of its own */
  HAMELIN_FOLLOWS_TARGETS = 4, /* it accepts goals of the type HAMELIN_GOAL_FOLLOW */
  /* It follows the paths of joint goals. Where a guide searches paths, other planners are shown
   * the way-points as joint goals, one after the other. */
  HAMELIN_FOLLOWS_PATHS = 8,
  HAMELIN_FOLLOWS_TRAJECTORIES = 16, /* it accepts joint goals with a trajectory */
  HAMELIN_ASKS_FOR_PATHS = 32,       /* it calls hamelin_host.request_path, if it needs paths */
  /* Near points are no matter to it while it follows a certified reference: where nothing moves and
   * the arm was within HAMELIN_ON_PATH of it, ticks list none. Functions that find them still do.
   */
  HAMELIN_TRUSTS_CERTIFIED_PATHS = 64
};

/* All functions never throw. They are called on one thread, that of tick, unless stated otherwise;
 * create and destroy may run on another one, but never while another function of the same planner
 * does. Those that return an int32_t return 0; on failure they return nonzero and write a
 * nul-terminated line to `error` (error_size bytes). */
typedef struct hamelin_plugin {
  uint32_t struct_size;
  uint32_t abi_version;     /* the newest version that the plugin supports */
  uint32_t abi_version_min; /* the oldest one */
  uint32_t properties;      /* sum of HAMELIN_TICK_ALLOCATES and the like, or 0 */
  const char* name;
  const char* version;
  const char* description;
  const char* params_schema; /* JSON Schema (draft-07) of the parameters: defaults, ranges, units */
  /* Makes a planner from checked parameters with all defaults filled in, and sets *out; on failure
   * *out is not set. */
  int32_t (*create)(const hamelin_host* host, const hamelin_setup* setup, const char* params_json,
                    size_t params_size, void** out, char* error, size_t error_size);
  /* Answers a tick. A failure ends the run as a defect. Does not allocate, unless the properties
   * say so. */
  int32_t (*tick)(void* planner, const hamelin_tick* tick, hamelin_command* command, char* error,
                  size_t error_size);
  void (*destroy)(void* planner);

  /* The functions below are optional: null if the plugin does without. */

  /* The distance up to which a planner with these parameters needs contacts [m]. The host calls it
   * before create, to crop the map and cull obstacles. A negative answer selects the host's
   * default. */
  double (*influence_m)(const char* params_json, size_t params_size);
  /* Changes of the parameters while the planner runs. prepare_params reads a complete set that was
   * checked against the schema. It may run on any thread while the planner works, so it reads only
   * what create made and nothing changes, but it may allocate. It fails if these parameters cannot
   * be changed now. apply_params makes prepared parameters those of the planner, before a tick and
   * on its thread; it does not allocate. free_params may run on any thread, also after destroy.
   * Either all three functions are null or none. */
  int32_t (*prepare_params)(const void* planner, const char* params_json, size_t params_size,
                            void** out, char* error, size_t error_size);
  void (*apply_params)(void* planner, const void* params);
  void (*free_params)(void* params);
  /* A new start from this state: forget what was learnt on the way. Called before a tick. */
  void (*reset)(void* planner, const double* q, const double* v);
  /* Obstacles or the map are others than at the tick before. Called before a tick whose
   * hamelin_tick.world has this number. */
  void (*world_changed)(void* planner, uint64_t world);
} hamelin_plugin;

typedef const hamelin_plugin* (*hamelin_plugin_entry_fn)(void);

#ifdef __cplusplus
}
#endif
#endif
