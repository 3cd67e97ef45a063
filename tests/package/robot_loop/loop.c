#include <hamelin/control/hamelin_control.h>
#include <stdio.h>
#include <string.h>

int main(int argc, char** argv) { /* loop_c SCENE PLUGIN_DIRECTORY */
  if (argc != 3) return 2;
  char error[256] = "";
  const char* const plugins = argv[2];
  const hamelin_controller_options options = {.struct_size = sizeof options,
                                              .scene_file = argv[1],
                                              .plugin_directories = &plugins,
                                              .plugin_directory_count = 1,
                                              .position = 1};
  hamelin_controller* arm = hamelin_controller_create(&options, error, sizeof error);
  if (arm == NULL || hamelin_controller_dof(arm) != 7) return fprintf(stderr, "%s\n", error), 1;

  /* These arrays stand in for the servos of a robot, which follow each command perfectly. */
  double q[7] = {0, -0.785, 0, -2.356, 0, 1.571, 0.785}, v[7] = {0}, clearance_m = 1.0;

  hamelin_answer answer = {.struct_size = sizeof answer};
  double now_s = 0.0;
  for (int k = 0; k < 20000 && answer.state == HAMELIN_CONTROL_RUNNING; ++k) {
    now_s = k * hamelin_controller_period_s(arm);
    hamelin_controller_tick(arm, now_s, q, v, &answer);
    if (answer.clearance_m < clearance_m) clearance_m = answer.clearance_m;
    memcpy(q, answer.q_next, sizeof q);
    memcpy(v, answer.v_next, sizeof v);
  }
  printf("%s after %g s, clearance %g m at least\n",
         answer.state == HAMELIN_CONTROL_REACHED ? "there" : "not there", now_s, clearance_m);
  hamelin_controller_destroy(arm);
  return 0;
}
