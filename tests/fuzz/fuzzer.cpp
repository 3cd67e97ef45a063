#include <cstdint>

#include "targets.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  hamelin::fuzz::HAMELIN_FUZZ_TARGET({reinterpret_cast<const char*>(data), size});
  return 0;
}
