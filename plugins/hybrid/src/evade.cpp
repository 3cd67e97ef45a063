#include "courses.hpp"

namespace hamelin::hybrid {

Motion Evade::step(Shared& s) const {
  s.evader.velocity(s.drive.q(), s.u);
  return {evasion_gain, evasion_acceleration, s.pace()};
}

}  // namespace hamelin::hybrid
