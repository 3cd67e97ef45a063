#ifndef HAMELIN_PLANNING_PLUGIN_ABI_H
#define HAMELIN_PLANNING_PLUGIN_ABI_H
/*
 * The border between hamelin and a planner plugin: C types only, so a plugin may be built by another compiler, with
 * other flags and another Eigen. The ABI number is all that must match. Plain structs begin with their size in bytes;
 * fields are only ever appended. Everything is SI, radians, float64; vectors are pointer + count. Pointers handed over
 * are valid during the call only. All calls of one planner come from one thread.
 *
 * Frames: "world" is the scene's; "link" is the frame at a link's centre of mass, as in the robot JSON.
 */
#include <stddef.h>
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif

#define HAMELIN_PLUGIN_ABI_VERSION 3u
#define HAMELIN_PLUGIN_ENTRY_NAME "hamelin_plugin_entry"

/* A control shape, a part of the arm that obstacles are measured from: a sphere, or a capsule, which is a sphere swept
 * along its axis from center - half_axis to center + half_axis. Listed once, in hamelin_setup, link by link, a link's
 * spheres first. */
typedef struct hamelin_sphere {
  int32_t link;          /* index of the moving link, 0 .. dof - 1 */
  int32_t index_in_link; /* among the link's "spheres" in the robot JSON; a capsule's among its "segments" */
  double center_link_m[3];
  double radius_m;
  double half_axis_link_m[3]; /* zero for a sphere */
} hamelin_sphere;

/* What a contact is with, where that is no obstacle of the scene: the map's occupied space; or space that the map does
 * not know, where the scene says that it blocks. */
#define HAMELIN_OBSTACLE_MAP (-1)
#define HAMELIN_OBSTACLE_UNKNOWN (-2)

/* One near obstacle point of one control shape. A capsule is nearest at one point of its axis, which stands for a
 * sphere's centre; a capsule along a wall has further contacts at other places of its axis. */
typedef struct hamelin_contact {
  int32_t sphere;              /* index into hamelin_setup.spheres */
  int32_t obstacle;            /* HAMELIN_OBSTACLE_MAP, _UNKNOWN, or the index of the scene's obstacle */
  double distance_m;           /* from the shape's surface; zero or below is contact */
  double arm_point_world_m[3]; /* on the shape's surface */
  double obstacle_point_world_m[3];
  double direction_world[3]; /* unit, from the obstacle towards the shape: the gradient of the distance */
  double obstacle_velocity_world_m_s[3];
} hamelin_contact;

/* The base, where a shape of the arm is meant that does not move. */
#define HAMELIN_SPHERE_OF_BASE (-1)

/* A near pair of control shapes of the arm itself, the nearest of two parts that may touch. Listed where the scene
 * models self-collision. */
typedef struct hamelin_self_contact {
  int32_t sphere_a, sphere_b; /* indices into hamelin_setup.spheres; b may be HAMELIN_SPHERE_OF_BASE */
  double distance_m;          /* between the surfaces; zero or below is contact */
  double point_a_world_m[3], point_b_world_m[3]; /* on the surfaces */
  double direction_world[3];                     /* unit, from b towards a */
} hamelin_self_contact;

enum { HAMELIN_GOAL_JOINT = 0, HAMELIN_GOAL_POSITION = 1, HAMELIN_GOAL_POSE = 2 };

typedef struct hamelin_goal {
  int32_t type;
  double position_world_m[3]; /* position, pose: where the tip shall be */
  double quaternion_wxyz[4];  /* pose */
  const double* q;            /* joint: dof numbers, else null */
  double tolerance_m, tolerance_rad, speed_max;
  /* A joint goal may be the end of a path: joint vectors to be followed, the goal's q the last of them. They guide;
   * only the end must be reached. Null and 0 without a path. */
  const double* path; /* path_points * dof numbers, point by point */
  size_t path_points;
} hamelin_goal;

/* A gyroscopic term: at this point of this link acts the force w x (velocity of the point). It does no work. */
typedef struct hamelin_gyroscopic_term {
  int32_t link;
  double point_link_m[3];
  double w_world[3]; /* [N s/m] */
} hamelin_gyroscopic_term;

/* What holds for a whole run; handed to create. The strings and spans stay valid as long as the planner lives. */
typedef struct hamelin_setup {
  uint32_t struct_size;
  size_t dof;
  const char* robot_json; /* the nominal robot, hamelin.robot/1, resolved; gravity and base follow */
  size_t robot_json_size;
  double gravity_world_m_s2[3];
  double base_position_world_m[3]; /* pose of the robot's base frame */
  double base_quaternion_wxyz[4];
  const hamelin_sphere* spheres;
  size_t sphere_count;
  const hamelin_goal* goals; /* to be reached in this order */
  size_t goal_count;
  /* Limits the scene models: dof numbers each, or null where it models none. Unlimited joints hold +-infinity. */
  const double *q_lower, *q_upper, *velocity_max, *effort_max;
  const double* effort_rate_max; /* [Nm/s or N/s] of the held torque, under sampled actuation */
  double control_period_s;       /* dt between two ticks */
  int32_t sampled; /* 0: channels act as they are; 1: all are summed into one torque, held for control_period_s */
  double delay_s;  /* under sampled actuation: how late that torque acts */
  int32_t self_collision;  /* 1: self contacts are listed */
  double influence_m;      /* contacts are listed up to this distance, asked from the plugin */
  double map_resolution_m; /* zero without a map */
  uint64_t seed;
  /* Appended to ABI 3; present if struct_size says so. What hamelin's kernels compute with in the host: "x86-64", "v3",
   * "v4" or "generic". A plugin that links hamelin's libraries has a copy of them, which should do the same. */
  const char* instruction_set;
} hamelin_setup;

/* One tick's input. */
typedef struct hamelin_tick {
  uint32_t struct_size;
  uint64_t k;
  double time_s;
  const double *q, *v;             /* dof numbers each */
  const hamelin_contact* contacts; /* several a shape, nearest first within a shape, shapes in order */
  size_t contact_count;
  size_t goal_index;
  double speed_scale; /* 1, or less where the arm is in unknown space and the scene says "slow" */
  const hamelin_self_contact* self_contacts; /* in the order of the pairs of parts, up to influence_m */
  size_t self_contact_count;
} hamelin_tick;

/* OWN_STALL_RULE: running, and the planner notices by itself when it stalls: the scene's rule does not apply. */
enum { HAMELIN_PLANNER_RUNNING = 0, HAMELIN_PLANNER_GAVE_UP = 1, HAMELIN_PLANNER_OWN_STALL_RULE = 2 };

/*
 * One tick's answer, in channels. The host owns the memory and clears it before each call; what is left alone acts not.
 *  a  potential: its value and gradient at q, applied as half-kicks at both nodes of the step
 *  b  damping:   torque -damping_i v_i, coefficients kept over the step
 *  c  gyroscopic terms, coefficients kept over the step
 *  d  held torque
 *  e  node velocity: the velocity right after this node, e.g. projected by a safety filter
 */
typedef struct hamelin_command {
  uint32_t struct_size;
  int32_t state;   /* HAMELIN_PLANNER_RUNNING, ... */
  char cause[128]; /* with GAVE_UP: why, nul-terminated, one line */
  double potential_J;
  double* potential_gradient;          /* dof */
  double* damping;                     /* dof, non-negative */
  hamelin_gyroscopic_term* gyroscopic; /* room for gyroscopic_capacity, at least one for each contact */
  size_t gyroscopic_capacity;
  size_t gyroscopic_count;
  double* held_torque;   /* dof */
  double* node_velocity; /* dof */
  int32_t has_node_velocity;
  /* Accounts of the planner's own for the log: energy taken out (negative) or put in at this node [J]. */
  double filter_work_J;   /* by rows that admit standing still: never above zero */
  double recovery_work_J; /* by rows that demand motion: inside a margin, past a limit, ... */
} hamelin_command;

enum { HAMELIN_LOG_INFO = 0, HAMELIN_LOG_WARNING = 1 };

/* Services of the host. Valid as long as the planner lives. */
typedef struct hamelin_host {
  uint32_t struct_size;
  void* context;
  /* [only inside create and tick] text is one line, not nul-terminated */
  void (*log)(void* context, int32_t level, const char* text, size_t size);
  /* [only inside create and tick] Contacts of the control shapes at any q, up to `influence_m`, obstacles standing
   * where they are now. Writes up to `capacity` of them and returns how many there are; if that is more than capacity,
   * the farthest are left out. */
  size_t (*closest_points)(void* context, const double* q, double influence_m, hamelin_contact* out, size_t capacity);
  /* [only inside create and tick] Self contacts at any q, in the same way. */
  size_t (*closest_self)(void* context, const double* q, double influence_m, hamelin_self_contact* out,
                         size_t capacity);
} hamelin_host;

typedef struct hamelin_plugin {
  uint32_t struct_size;
  uint32_t abi_version;
  const char* name;
  const char* version;
  const char* description;
  const char* params_schema; /* JSON Schema (draft-07) of the parameters: defaults, ranges, units */
  /*
   * Makes a planner from checked parameters with all defaults filled in. Returns 0 and sets *out; else writes a
   * nul-terminated line to `error` (error_size bytes) and leaves *out alone. Never throws.
   */
  int32_t (*create)(const hamelin_host* host, const hamelin_setup* setup, const char* params_json, size_t params_size,
                    void** out, char* error, size_t error_size);
  /* Answers a tick. Returns 0, or nonzero with a line in `error`: the run ends as a defect. Never throws, does not
   * allocate. */
  int32_t (*tick)(void* planner, const hamelin_tick* tick, hamelin_command* command, char* error, size_t error_size);
  void (*destroy)(void* planner);
  /* How far obstacles matter to a planner with these parameters [m]; asked before create, so that the host crops and
   * culls by it. Null or a negative answer: the host's default. */
  double (*influence_m)(const char* params_json, size_t params_size);
} hamelin_plugin;

typedef const hamelin_plugin* (*hamelin_plugin_entry_fn)(void);

#ifdef __cplusplus
}
#endif
#endif
