#ifndef HAMELIN_PLANNING_TESTS_LATER_HOST_H
#define HAMELIN_PLANNING_TESTS_LATER_HOST_H
#ifdef __cplusplus
extern "C" {
#endif

/* What a planner answered in a host of a later version, and what it wrote where it should not. */
typedef struct later_answer {
  char error[256]; /* empty if all went well */
  double damping[3], held_torque[3], series[2];
  double gyroscopic_link; /* of the first gyroscopic term; -1: there is none */
  int overwritten;        /* 1: fields that the planner cannot know were changed */
} later_answer;

/* Runs one tick of the plugin in the file: an arm of three joints, four shapes of radius 0.5, two
 * goals of tolerance 0.25, the contacts' distances 1, 2 and 3, and those of closest_points 4 and 5.
 * The host was built with the header of a later version: all structs are longer, versions 4 to 6.
 */
void later_host_tick(const char* plugin_file, const char* robot_json, const char* params_json,
                     later_answer* out);

#ifdef __cplusplus
}
#endif
#endif
