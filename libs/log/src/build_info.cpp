#include "build_info.hpp"

namespace hamelin::log {

const BuildInfo& build_info() noexcept {
  static constexpr BuildInfo info{HAMELIN_COMPILER,   HAMELIN_BUILD_FLAGS, HAMELIN_BUILD_TYPE,
                                  HAMELIN_SANITIZERS, HAMELIN_GIT_COMMIT,  HAMELIN_OCTOMAP_VERSION};
  return info;
}

}  // namespace hamelin::log
