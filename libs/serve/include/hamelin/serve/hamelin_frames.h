#ifndef HAMELIN_FRAMES_H
#define HAMELIN_FRAMES_H
/*
 * What the driver of an arm exchanges with `hamelin serve` in each period: a measurement, and the
 * set point that answers it. Both lie in shared memory. A Unix socket says when one of them is new.
 * Numbers have the byte order and the alignment of the machine. Units: metres, radians, seconds,
 * Newton, Nm; per prismatic joint metres and Newton.
 *
 * 1. Connect to the socket (SOCK_SEQPACKET). The first message of the server has the 8 bytes of
 *    HAMELIN_LINK_MAGIC and a file descriptor (SCM_RIGHTS); map sizeof(hamelin_link) bytes of it.
 *    A server that has another client already closes the connection instead.
 * 2. Check magic, version and size of hamelin_link.
 * 3. In each period: write the measurement with the next sequence number and its checksum, and
 *    send the 8 bytes of that number. Receive 8 bytes: the number of the set point that is in the
 *    memory now. Copy it, check its checksum, and send it to the arm.
 *
 * If no measurement comes in time, the server goes on with where the model of the arm takes it, and
 * sends a set point all the same; after some of them in a row the arm is brought to rest. A frame
 * that comes later, comes again or is damaged is counted and not used. A client that sends no
 * further frames, or closes the socket, leaves an arm that is being stopped: the next client sees
 * HAMELIN_CONTROL_STOPPING until it requests to resume.
 *
 * Any other message of the client is a JSON object, and is answered by one: see README.md of serve.
 */
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define HAMELIN_LINK_MAGIC UINT64_C(0x6b6e696c6c6d6168) /* "hamllink" in memory */
enum { HAMELIN_LINK_VERSION = 1, HAMELIN_LINK_JOINTS = 32, HAMELIN_LINK_TEXT = 192 };

/* What the client asks for besides a set point. Each is done once, when it changes. */
enum {
  HAMELIN_REQUEST_NONE = 0,
  HAMELIN_REQUEST_STOP = 1,   /* bring the arm to rest, and hold it */
  HAMELIN_REQUEST_RESUME = 2, /* go on after a stop */
  HAMELIN_REQUEST_RESET = 3   /* start again from this measurement; takes longer than a period */
};

typedef struct hamelin_measurement {
  uint64_t sequence; /* of the period: from 1; after a pause the newest set point's + 1 */
  double time_s;     /* when it was measured; does not fall */
  double q[HAMELIN_LINK_JOINTS]; /* joint positions; zeros after the last joint */
  double v[HAMELIN_LINK_JOINTS]; /* joint velocities; not used if the scene has them estimated */
  uint32_t request;              /* HAMELIN_REQUEST_... */
  uint32_t checksum;             /* hamelin_checksum() of all bytes before it */
} hamelin_measurement;

enum {
  HAMELIN_SETPOINT_SATURATED = 1, /* a limit reduced the torque */
  HAMELIN_SETPOINT_SHIELDED = 2,  /* the shield refused the planner's answer */
  HAMELIN_SETPOINT_UNSEEN = 4,    /* it is for a period without a measurement */
  HAMELIN_SETPOINT_NOT_BEGUN = 8  /* the arm cannot begin, see cause; nothing may be sent */
};

typedef struct hamelin_setpoint {
  uint64_t sequence; /* of the period that it is for */
  double time_s;     /* of that period */
  double torque[HAMELIN_LINK_JOINTS];
  double q[HAMELIN_LINK_JOINTS]; /* one period ahead, if the link is for positions; else zeros */
  double v[HAMELIN_LINK_JOINTS];
  double clearance_m;            /* of the whole arm, as in hamelin_answer */
  int32_t state;                 /* HAMELIN_CONTROL_... of hamelin_control.h */
  int32_t reason;                /* HAMELIN_STOP_..., where it stops */
  uint32_t flags;                /* HAMELIN_SETPOINT_... */
  uint32_t goal_index;           /* of the current goal; the number of goals after the last */
  uint64_t lost, late, damaged;  /* measurements so far: never came, too late or again, damaged */
  char cause[HAMELIN_LINK_TEXT]; /* why it stops; one line, ends with 0 */
  uint32_t reserved;
  uint32_t checksum; /* hamelin_checksum() of all bytes before it */
} hamelin_setpoint;

typedef struct hamelin_link {
  uint64_t magic;    /* HAMELIN_LINK_MAGIC */
  uint32_t version;  /* HAMELIN_LINK_VERSION */
  uint32_t size;     /* sizeof(hamelin_link) */
  uint32_t joints;   /* of the arm */
  uint32_t position; /* 1: the arm is sent positions and velocities; 0: torques */
  double period_s;
  hamelin_measurement measurement; /* written by the client */
  hamelin_setpoint setpoint;       /* written by the server */
} hamelin_link;

/* CRC-32 as in zlib, by half bytes. */
static inline uint32_t hamelin_checksum(const void* data, size_t size) {
  static const uint32_t of_half[16] = {0x00000000U, 0x1db71064U, 0x3b6e20c8U, 0x26d930acU,
                                       0x76dc4190U, 0x6b6b51f4U, 0x4db26158U, 0x5005713cU,
                                       0xedb88320U, 0xf00f9344U, 0xd6d6a3e8U, 0xcb61b38cU,
                                       0x9b64c2b0U, 0x86d3d2d4U, 0xa00ae278U, 0xbdbdf21cU};
  const unsigned char* bytes = (const unsigned char*)data;
  uint32_t crc = 0xffffffffU;
  for (size_t i = 0; i < size; ++i) {
    crc ^= bytes[i];
    crc = (crc >> 4) ^ of_half[crc & 15U];
    crc = (crc >> 4) ^ of_half[crc & 15U];
  }
  return ~crc;
}

static inline uint32_t hamelin_measurement_checksum(const hamelin_measurement* frame) {
  return hamelin_checksum(frame, offsetof(hamelin_measurement, checksum));
}

static inline uint32_t hamelin_setpoint_checksum(const hamelin_setpoint* frame) {
  return hamelin_checksum(frame, offsetof(hamelin_setpoint, checksum));
}

#ifdef __cplusplus
}
#endif
#endif
