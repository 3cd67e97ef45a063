#include "hamelin/geometry/eigen_alignment.hpp"

extern "C" {
const char HAMELIN_EIGEN_ALIGNMENT = EIGEN_MAX_ALIGN_BYTES;
}
