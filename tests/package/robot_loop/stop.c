#include <hamelin/control/hamelin_control.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define CHECK(succeeded) \
  if (!(succeeded)) return fprintf(stderr, "%s\n", error), 1

int main(int argc, char** argv) { /* stop_c SCENE PLUGIN_DIRECTORY */
  if (argc != 3) return 2;
  char error[256] = "";
  const char* const plugins = argv[2];
  const double tracking_max[7] = {0.05, 0.05, 0.05, 0.05, 0.1, 0.1, 0.1};
  const hamelin_controller_options options = {.struct_size = sizeof options,
                                              .scene_file = argv[1],
                                              .plugin_directories = &plugins,
                                              .plugin_directory_count = 1,
                                              .position = 1,
                                              .tracking_max = tracking_max,
                                              .tracking_max_count = 7};
  hamelin_controller* arm = hamelin_controller_create(&options, error, sizeof error);
  CHECK(arm != NULL && hamelin_controller_dof(arm) == 7);
  CHECK(hamelin_controller_set_goals(
            arm,
            "[{\"type\": \"joint\", \"q\": [0.484, -0.739, 0.469, -0.908, 0.081, 2.413, 0.596]}]",
            NULL, NULL, error, sizeof error) == 0);

  /* These arrays stand in for the servos of a robot, which follow each command perfectly. */
  double q[7] = {0, -0.785, 0, -2.356, 0, 1.571, 0.785}, v[7] = {0}, clearance_m = 1.0;

  hamelin_answer answer = {.struct_size = sizeof answer};
  double now_s = 0.0, speed = 0.0;
  for (int k = 0; k < 20000 && answer.state != HAMELIN_CONTROL_REACHED; ++k) {
    now_s = k * hamelin_controller_period_s(arm);
    if (k == 300) /* any thread may do this at any time */
      CHECK(hamelin_controller_stop(arm, "the door is open", error, sizeof error) == 0);
    if (answer.reason == HAMELIN_STOP_REQUEST && speed < 1e-3)
      CHECK(hamelin_controller_resume(arm, error, sizeof error) == 0);
    hamelin_controller_tick(arm, now_s, q, v, &answer);
    if (answer.clearance_m < clearance_m) clearance_m = answer.clearance_m;
    memcpy(q, answer.q_next, sizeof q);
    memcpy(v, answer.v_next, sizeof v);
    speed = 0.0;
    for (int i = 0; i < 7; ++i) speed = fmax(speed, fabs(v[i]));
  }
  hamelin_shield shield = {.struct_size = sizeof shield};
  CHECK(hamelin_controller_shield(arm, &shield, error, sizeof error) == 0);
  printf("%s after %g s, clearance %g m at least\n",
         answer.state == HAMELIN_CONTROL_REACHED && shield.steps > 0 ? "there" : "not there", now_s,
         clearance_m);
  hamelin_controller_destroy(arm);
  return 0;
}
