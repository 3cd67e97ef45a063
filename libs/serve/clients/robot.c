/*
 * A driver of an arm as a client of `hamelin serve`, in C11 on Linux.
 *
 *     cc -std=c11 -O2 -I ../include robot.c -o robot -lm
 *     hamelin serve reach.json --socket /run/user/1000/arm &
 *     ./robot /run/user/1000/arm --start 0,-0.785,0,-2.356,0,1.571,0.785
 *
 * Replace read_arm() and write_arm() by calls of the arm's own interface. As they are, they
 * simulate servos that follow their set points exactly, which is why this file as it is refuses a
 * server of torques: what torques do to an arm needs a model of it, see `hamelin plant`.
 *
 * --resume lets an arm go on that was stopped when the client before has gone. The program ends
 * when the goals are reached (exit code 0), when the arm cannot begin, gives up, stalls or remains
 * stopped (1), and after Ctrl-C, when the server has brought the arm to rest (130).
 */
#define _GNU_SOURCE
#include <errno.h>
#include <hamelin/serve/hamelin_frames.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

/* As HAMELIN_CONTROL_... of hamelin_control.h. */
enum { RUNNING = 0, REACHED = 1, STALLED = 2, GAVE_UP = 3, STOPPING = 4 };
/* After so many periods in a row without a set point the driver holds the arm by itself. */
enum { MISSED_MAX = 20 };
/* After so many periods at rest in a stop that nobody ends the program does. */
enum { RESTS_MAX = 2000 };

struct arm { /* the simulated one */
  double q[HAMELIN_LINK_JOINTS], v[HAMELIN_LINK_JOINTS];
};

/* The joint positions and velocities that the arm measures. */
static void read_arm(const struct arm* arm, double* q, double* v) {
  memcpy(q, arm->q, sizeof arm->q);
  memcpy(v, arm->v, sizeof arm->v);
}

/* Sends a set point to the servos. */
static void write_arm(struct arm* arm, const hamelin_setpoint* setpoint) {
  memcpy(arm->q, setpoint->q, sizeof arm->q);
  memcpy(arm->v, setpoint->v, sizeof arm->v);
}

/* The driver's own watchdog: no set point has come for too long. Here servos hold their position.
 */
static void hold_arm(struct arm* arm) {
  memset(arm->v, 0, sizeof arm->v);
}

struct link {
  int socket;
  hamelin_link* memory;
  hamelin_setpoint setpoint; /* the last one that was whole */
  uint64_t damaged;
};

static volatile sig_atomic_t interrupted = 0;

static void on_interrupt(int number) {
  (void)number;
  interrupted = 1;
}

static int fail(const char* what) {
  fprintf(stderr, "robot: %s: %s\n", what, errno != 0 ? strerror(errno) : "unexpected message");
  return -1;
}

/* The first message: the magic number, and the descriptor of the memory. */
static int receive_memory(int socket) {
  uint64_t magic = 0;
  struct iovec part = {&magic, sizeof magic};
  union {
    struct cmsghdr header;
    char bytes[CMSG_SPACE(sizeof(int))];
  } control;
  struct msghdr message = {0};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.bytes;
  message.msg_controllen = sizeof control.bytes;
  errno = 0;
  const ssize_t got = recvmsg(socket, &message, MSG_CMSG_CLOEXEC);
  const struct cmsghdr* const header = got > 0 ? CMSG_FIRSTHDR(&message) : NULL;
  if (got == 0) fprintf(stderr, "robot: the server has another client\n");
  if (got != sizeof magic || magic != HAMELIN_LINK_MAGIC || header == NULL) return -1;
  int memory = -1;
  memcpy(&memory, CMSG_DATA(header), sizeof memory);
  return memory;
}

static int open_link(struct link* link, const char* path) {
  struct sockaddr_un address = {0};
  address.sun_family = AF_UNIX;
  if (strlen(path) >= sizeof address.sun_path) return fail("path too long");
  strcpy(address.sun_path, path);
  link->socket = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
  if (link->socket < 0) return fail("socket");
  if (connect(link->socket, (const struct sockaddr*)&address, sizeof address) != 0)
    return fail(path);
  const int memory = receive_memory(link->socket);
  if (memory < 0) return fail("no memory");
  void* const at = mmap(NULL, sizeof(hamelin_link), PROT_READ | PROT_WRITE, MAP_SHARED, memory, 0);
  close(memory);
  if (at == MAP_FAILED) return fail("mmap");
  link->memory = at;
  if (link->memory->magic != HAMELIN_LINK_MAGIC || link->memory->version != HAMELIN_LINK_VERSION ||
      link->memory->size != sizeof(hamelin_link))
    return fail("the server has another version of the frames");
  return 0;
}

static int send_measurement(struct link* link, hamelin_measurement* frame) {
  frame->checksum = hamelin_measurement_checksum(frame);
  memcpy(&link->memory->measurement, frame, sizeof *frame);
  const ssize_t sent =
      send(link->socket, &frame->sequence, sizeof frame->sequence, MSG_NOSIGNAL | MSG_DONTWAIT);
  return sent > 0 || errno == EAGAIN ? 0 : fail("the server has gone");
}

/* Takes the newest set point, waiting at most so long for that of a period. Returns 1 if there is
   one for that period, 0 if not, and -1 if the server has gone. */
static int receive_setpoint(struct link* link, uint64_t sequence, double timeout_s) {
  struct timespec until, now;
  clock_gettime(CLOCK_MONOTONIC, &until);
  const double until_s = (double)until.tv_sec + 1e-9 * (double)until.tv_nsec + timeout_s;
  while (link->setpoint.sequence < sequence) {
    clock_gettime(CLOCK_MONOTONIC, &now);
    const double left_s = until_s - ((double)now.tv_sec + 1e-9 * (double)now.tv_nsec);
    if (left_s <= 0.0) return 0;
    const struct timespec left = {(time_t)left_s, (long)(1e9 * fmod(left_s, 1.0))};
    struct pollfd one = {link->socket, POLLIN, 0};
    if (ppoll(&one, 1, &left, NULL) <= 0) continue;
    char message[4096];
    const ssize_t size = recv(link->socket, message, sizeof message, MSG_DONTWAIT);
    if (size == 0 || (size < 0 && errno != EAGAIN && errno != EINTR)) return -1;
    if (size != sizeof(uint64_t))
      continue; /* the answer of a request, which this one never sends */
    hamelin_setpoint newest;
    memcpy(&newest, &link->memory->setpoint, sizeof newest);
    if (newest.checksum == hamelin_setpoint_checksum(&newest))
      link->setpoint = newest;
    else
      ++link->damaged;
  }
  return 1;
}

static void add_period(struct timespec* at, double period_s) {
  at->tv_nsec += (long)(1e9 * period_s);
  at->tv_sec += at->tv_nsec / 1000000000;
  at->tv_nsec %= 1000000000;
}

/* Whether the run is over, and then how the program ends. */
static int is_over(const struct link* link, int* rests_for, int* code) {
  const hamelin_setpoint* const setpoint = &link->setpoint;
  double speed = 0.0;
  for (uint32_t j = 0; j < link->memory->joints; ++j) speed = fmax(speed, fabs(setpoint->v[j]));
  *rests_for = setpoint->state == STOPPING && speed < 1e-6 ? *rests_for + 1 : 0;
  *code = interrupted ? 130 : 1;
  if ((setpoint->flags & HAMELIN_SETPOINT_NOT_BEGUN) != 0) return 1;
  if (setpoint->state == REACHED) *code = 0;
  if (setpoint->state == REACHED || setpoint->state == STALLED || setpoint->state == GAVE_UP)
    return 1;
  return *rests_for > (interrupted ? 0 : RESTS_MAX);
}

/* One period: a measurement goes out, and what has come back by its end acts on the arm. Returns -1
   if the server has gone. */
static int exchange(struct link* link, struct arm* arm, hamelin_measurement* frame, int* missed) {
  const uint64_t before = link->setpoint.sequence;
  /* after a pause the server's periods are ahead of those counted here */
  frame->sequence = (before > frame->sequence ? before : frame->sequence) + 1;
  read_arm(arm, frame->q, frame->v);
  if (interrupted) frame->request = HAMELIN_REQUEST_STOP;
  if (send_measurement(link, frame) != 0) return -1;
  /* the first one may take longer than a period */
  const double timeout_s = before == 0 ? 1.0 : 0.8 * link->memory->period_s;
  if (receive_setpoint(link, frame->sequence, timeout_s) < 0) return fail("the server has gone");
  *missed = link->setpoint.sequence > before ? 0 : *missed + 1;
  if (*missed == 0 && (link->setpoint.flags & HAMELIN_SETPOINT_NOT_BEGUN) == 0)
    write_arm(arm, &link->setpoint);
  else if (*missed > MISSED_MAX)
    hold_arm(arm); /* a set point that does not come is the last one, but not for ever */
  return 0;
}

static void wait_for_period(struct timespec* due, double period_s) {
  struct timespec now;
  add_period(due, period_s);
  clock_gettime(CLOCK_MONOTONIC, &now);
  if (now.tv_sec > due->tv_sec + 1) *due = now; /* a pause is not made up for */
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, due, NULL);
}

static int run(struct link* link, struct arm* arm, uint32_t request) {
  hamelin_measurement frame = {0};
  struct timespec due;
  int code = 1, missed = 0, rests_for = 0;
  uint64_t lost = 0;
  frame.request = request;
  clock_gettime(CLOCK_MONOTONIC, &due);
  do {
    frame.time_s = (double)due.tv_sec + 1e-9 * (double)due.tv_nsec;
    if (exchange(link, arm, &frame, &missed) != 0) return 1;
    lost += missed > 0;
    wait_for_period(&due, link->memory->period_s);
  } while (!is_over(link, &rests_for, &code));
  printf("%llu periods, %llu without a set point; state %d, goal %u%s%s\n",
         (unsigned long long)frame.sequence, (unsigned long long)lost, link->setpoint.state,
         link->setpoint.goal_index, link->setpoint.cause[0] != 0 ? ": " : "", link->setpoint.cause);
  printf("the arm is at ");
  for (uint32_t j = 0; j < link->memory->joints; ++j) printf("%s%.9g", j > 0 ? "," : "", arm->q[j]);
  printf("\n");
  return code;
}

static int parse_start(struct arm* arm, const char* text) {
  char* end = NULL;
  for (int j = 0; j < HAMELIN_LINK_JOINTS; ++j, text = end + 1) {
    arm->q[j] = strtod(text, &end);
    if (end == text) return -1;
    if (*end != ',') return *end == 0 ? 0 : -1;
  }
  return -1;
}

int main(int argc, char** argv) {
  struct arm arm = {{0}, {0}};
  struct link link = {0};
  uint32_t request = HAMELIN_REQUEST_NONE;
  int good = argc >= 2;
  for (int i = 2; i < argc && good; ++i) {
    if (strcmp(argv[i], "--resume") == 0)
      request = HAMELIN_REQUEST_RESUME;
    else
      good = strcmp(argv[i], "--start") == 0 && ++i < argc && parse_start(&arm, argv[i]) == 0;
  }
  if (!good) {
    fprintf(stderr, "usage: robot SOCKET [--start Q,Q,...] [--resume]\n");
    return 2;
  }
  struct sigaction action = {0};
  action.sa_handler = on_interrupt; /* without SA_RESTART: waiting ends */
  sigaction(SIGINT, &action, NULL);
  sigaction(SIGTERM, &action, NULL);
  if (open_link(&link, argv[1]) != 0) return 2;
  if (link.memory->position == 0) {
    fprintf(stderr, "robot: the server sends torques, expected positions: see read_arm()\n");
    return 2;
  }
  printf("%u joints, a period of %g s\n", link.memory->joints, link.memory->period_s);
  fflush(stdout);
  return run(&link, &arm, request);
}
