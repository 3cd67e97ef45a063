#include <hamelin/control/hamelin_control.h>
#include <stdio.h>
#include <string.h>

#define CHECK(succeeded) \
  if (!(succeeded)) return fprintf(stderr, "%s\n", error), 1

int main(int argc, char** argv) { /* live_c SCENE PLUGIN_DIRECTORY */
  if (argc != 3) return 2;
  char error[256] = "";
  const char* const plugins = argv[2];
  const hamelin_controller_options options = {.struct_size = sizeof options,
                                              .scene_file = argv[1],
                                              .plugin_directories = &plugins,
                                              .plugin_directory_count = 1,
                                              .position = 1};
  hamelin_controller* arm = hamelin_controller_create(&options, error, sizeof error);
  CHECK(arm != NULL && hamelin_controller_dof(arm) == 7);

  /* These arrays stand in for the servos of a robot, which follow each command perfectly. */
  const double home[7] = {0, -0.785, 0, -2.356, 0, 1.571, 0.785};
  double q[7], v[7] = {0}, clearance_m = 1.0;
  memcpy(q, home, sizeof q);

  const hamelin_obstacle ball = {.struct_size = sizeof ball,
                                 .name = "ball",
                                 .shape = HAMELIN_SPHERE,
                                 .radius_m = 0.08,
                                 .position_m = {0.5, 0.6, 0.6},
                                 .quaternion_wxyz = {1, 0, 0, 0}};
  CHECK(hamelin_controller_set_obstacle(arm, &ball, NULL, error, sizeof error) == 0);

  const double velocity_m_s[3] = {0.0, -0.1, 0.0};
  uint64_t to_home = UINT64_MAX;
  hamelin_answer answer = {.struct_size = sizeof answer};
  int k = 0;
  for (; k < 20000 && !(answer.state == HAMELIN_CONTROL_REACHED && answer.goals == to_home); ++k) {
    const double now_s = k * hamelin_controller_period_s(arm);
    if (k == 500) { /* any thread may make such changes at any time */
      CHECK(hamelin_controller_move_obstacle(arm, ball.name, ball.position_m, ball.quaternion_wxyz,
                                             velocity_m_s, now_s, NULL, error, sizeof error) == 0);
      CHECK(hamelin_controller_set_joint_goal(arm, home, 0.0, &to_home, error, sizeof error) == 0);
    }
    hamelin_controller_tick(arm, now_s, q, v, &answer);
    if (answer.clearance_m < clearance_m) clearance_m = answer.clearance_m;
    memcpy(q, answer.q_next, sizeof q);
    memcpy(v, answer.v_next, sizeof v);
  }
  printf("%s after %g s, clearance %g m at least\n", k < 20000 ? "home" : "not home",
         k * hamelin_controller_period_s(arm), clearance_m);
  hamelin_controller_destroy(arm);
  return 0;
}
