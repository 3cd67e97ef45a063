#pragma once
#include "hamelin/search/search.hpp"
#include "hamelin/test/skip.hpp"

namespace hamelin::test {

/// Skips the test if this build has no guides.
inline void require_guides() {
  skip_unless(search::available(), "this build is without OMPL");
}

}  // namespace hamelin::test
