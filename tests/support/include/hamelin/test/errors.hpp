#pragma once
#include <string>

#include "hamelin/core/error.hpp"

namespace hamelin::test {

/// @return what the Error says that `call` throws; "no error" if it throws none
template <class Call>
std::string error_of(const Call& call) {
  try {
    call();
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

}  // namespace hamelin::test
