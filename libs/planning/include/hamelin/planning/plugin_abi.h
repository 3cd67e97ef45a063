#ifndef HAMELIN_PLANNING_PLUGIN_ABI_H
#define HAMELIN_PLANNING_PLUGIN_ABI_H
/*
 * The interface between hamelin and a planner plugin. It uses C types only, so a plugin may be
 * built by another compiler, with other flags and another Eigen; only the ABI number must match.
 * Structs that are passed by pointer begin with their size in bytes, and within one ABI number
 * fields are only appended to them. All quantities are in SI units and radians, as 64-bit
 * floating-point numbers. Arrays are a pointer and a count. Unless stated otherwise, pointers are
 * valid only during the call. All calls of one planner come from one thread.
 *
 * Frames: "world" is the scene's frame; "link" is the frame at a link's centre of mass, as in the
 * robot JSON.
 */
#include <stddef.h>
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif

#define HAMELIN_PLUGIN_ABI_VERSION 3u
#define HAMELIN_PLUGIN_ENTRY_NAME "hamelin_plugin_entry"

/* A control shape: a part of the arm from which distances to obstacles are measured. It is a
 * sphere, or a capsule, which is a sphere swept along its axis from center - half_axis to center +
 * half_axis. hamelin_setup lists all shapes, link by link, the spheres of a link first. */
typedef struct hamelin_sphere {
  int32_t link;          /* index of the moving link, 0 .. dof - 1 */
  int32_t index_in_link; /* in the link's "spheres" of the JSON; for a capsule in "segments" */
  double center_link_m[3];
  double radius_m;
  double half_axis_link_m[3]; /* zero for a sphere */
} hamelin_sphere;

/* Values of hamelin_contact.obstacle that are not the index of an obstacle of the scene: the
 * occupied space of the map, and space that the map does not know, in scenes where it blocks. */
#define HAMELIN_OBSTACLE_MAP (-1)
#define HAMELIN_OBSTACLE_UNKNOWN (-2)

/* One near obstacle point of one control shape. For a capsule, the nearest point of its axis takes
 * the role of a sphere's centre; a capsule along a wall has further contacts at other points of its
 * axis. */
typedef struct hamelin_contact {
  int32_t sphere;              /* index into hamelin_setup.spheres */
  int32_t obstacle;            /* HAMELIN_OBSTACLE_MAP, _UNKNOWN, or index of a scene obstacle */
  double distance_m;           /* from the shape's surface; zero or less means contact */
  double arm_point_world_m[3]; /* on the shape's surface */
  double obstacle_point_world_m[3];
  double direction_world[3]; /* unit, from the obstacle to the shape: gradient of the distance */
  double obstacle_velocity_world_m_s[3];
} hamelin_contact;

/* The base, in place of the index of a shape: a part of the arm that does not move. */
#define HAMELIN_SPHERE_OF_BASE (-1)

/* A near pair of control shapes of the arm itself: the nearest pair of two parts that may touch.
 * Such pairs are listed if the scene models self-collision. */
typedef struct hamelin_self_contact {
  int32_t sphere_a, sphere_b; /* index into hamelin_setup.spheres; b also HAMELIN_SPHERE_OF_BASE */
  double distance_m;          /* between the surfaces; zero or less means contact */
  double point_a_world_m[3], point_b_world_m[3]; /* on the surfaces */
  double direction_world[3];                     /* unit, from b towards a */
} hamelin_self_contact;

enum { HAMELIN_GOAL_JOINT = 0, HAMELIN_GOAL_POSITION = 1, HAMELIN_GOAL_POSE = 2 };

typedef struct hamelin_goal {
  int32_t type;
  double position_world_m[3]; /* position and pose goals: desired position of the tip */
  double quaternion_wxyz[4];  /* pose goals: desired orientation of the tip */
  const double* q;            /* joint goals: dof numbers; else null */
  double tolerance_m, tolerance_rad, speed_max;
  /* A joint goal may be the end of a path of joint vectors, of which the goal's q is the last. The
   * path is a guide; only its end must be reached. Null and 0 without a path. */
  const double* path; /* path_points * dof numbers, point by point */
  size_t path_points;
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
  const hamelin_sphere* spheres;
  size_t sphere_count;
  const hamelin_goal* goals; /* in the order in which they must be reached */
  size_t goal_count;
  /* Limits: dof numbers each, or null if the scene does not model them. Unlimited joints have
   * +-infinity. */
  const double *q_lower, *q_upper, *velocity_max, *effort_max;
  const double* effort_rate_max; /* rate of the torque [Nm/s or N/s], sampled actuation only */
  double control_period_s;       /* time between two ticks */
  int32_t sampled; /* 0: channels act separately; 1: summed into one torque per control_period_s */
  double delay_s;  /* under sampled actuation: the delay until that torque acts */
  int32_t self_collision;  /* 1: ticks list self contacts */
  double influence_m;      /* ticks list contacts up to this distance */
  double map_resolution_m; /* edge of the map's smallest box; zero without a map */
  uint64_t seed;
  /* Appended to ABI 3; present if struct_size covers it. The instruction set of the host's kernels:
   * "x86-64", "v3", "v4" or "generic". A plugin that links hamelin's libraries has its own copy of
   * them and should use the same set. */
  const char* instruction_set;
} hamelin_setup;

/* The input of one tick. */
typedef struct hamelin_tick {
  uint32_t struct_size;
  uint64_t k;
  double time_s;
  const double *q, *v;             /* dof numbers each */
  const hamelin_contact* contacts; /* ordered by shape, then by distance */
  size_t contact_count;
  size_t goal_index;
  double speed_scale; /* 1, or less in unknown space if the scene's policy is "slow" */
  const hamelin_self_contact* self_contacts; /* ordered by pair of parts, up to influence_m */
  size_t self_contact_count;
} hamelin_tick;

/* OWN_STALL_RULE: running, and the planner detects its stalls itself: the scene's stall rule is
 * disabled. */
enum {
  HAMELIN_PLANNER_RUNNING = 0,
  HAMELIN_PLANNER_GAVE_UP = 1,
  HAMELIN_PLANNER_OWN_STALL_RULE = 2
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
  size_t gyroscopic_capacity;
  size_t gyroscopic_count;
  double* held_torque;   /* dof */
  double* node_velocity; /* dof */
  int32_t has_node_velocity;
  /* The planner's own accounts for the log: energy removed (negative) or added at this node. */
  double filter_work_J;   /* by constraints that admit rest: never above zero */
  double recovery_work_J; /* by constraints that demand motion, as inside a margin */
} hamelin_command;

enum { HAMELIN_LOG_INFO = 0, HAMELIN_LOG_WARNING = 1 };

/* Services of the host, valid until destroy. */
typedef struct hamelin_host {
  uint32_t struct_size;
  void* context;
  /* [only inside create and tick] Writes one line to the log; the text is not nul-terminated. */
  void (*log)(void* context, int32_t level, const char* text, size_t size);
  /* [only inside create and tick] Finds the contacts of the control shapes at any q, up to
   * `influence_m`, with the obstacles at their present positions. Writes up to `capacity` of them
   * and returns their number; if that is more than capacity, the farthest are left out. */
  size_t (*closest_points)(void* context, const double* q, double influence_m, hamelin_contact* out,
                           size_t capacity);
  /* [only inside create and tick] Finds the self contacts at any q, in the same way. */
  size_t (*closest_self)(void* context, const double* q, double influence_m,
                         hamelin_self_contact* out, size_t capacity);
} hamelin_host;

typedef struct hamelin_plugin {
  uint32_t struct_size;
  uint32_t abi_version;
  const char* name;
  const char* version;
  const char* description;
  const char* params_schema; /* JSON Schema (draft-07) of the parameters: defaults, ranges, units */
  /*
   * Makes a planner from checked parameters with all defaults filled in. Returns 0 and sets *out;
   * on failure returns nonzero, writes a nul-terminated line to `error` (error_size bytes) and does
   * not set *out. Never throws.
   */
  int32_t (*create)(const hamelin_host* host, const hamelin_setup* setup, const char* params_json,
                    size_t params_size, void** out, char* error, size_t error_size);
  /* Answers a tick. Returns 0; on failure returns nonzero with a line in `error`, and the run ends
   * as a defect. Never throws, does not allocate. */
  int32_t (*tick)(void* planner, const hamelin_tick* tick, hamelin_command* command, char* error,
                  size_t error_size);
  void (*destroy)(void* planner);
  /* The distance up to which a planner with these parameters needs contacts [m]. The host calls it
   * before create, to crop the map and cull obstacles. Null or a negative answer selects the host's
   * default. */
  double (*influence_m)(const char* params_json, size_t params_size);
} hamelin_plugin;

typedef const hamelin_plugin* (*hamelin_plugin_entry_fn)(void);

#ifdef __cplusplus
}
#endif
#endif
