#pragma once
#include <string>

#include "hamelin/core/error.hpp"

namespace hamelin::optimal {

[[noreturn]] inline void refuse(const std::string& what) {
  throw Error(ErrorCode::invalid, what);
}

}  // namespace hamelin::optimal
