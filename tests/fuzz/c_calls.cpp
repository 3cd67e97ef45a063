// hamelin_c_calls COUNT SEED: makes so many calls of the C interface, in random order and with
// random arguments, without a fuzzer. Aborts at the first that breaks a rule of c_interface.cpp.
#include <fmt/format.h>

#include <cstdlib>
#include <string>

#include "hamelin/core/rng.hpp"
#include "targets.hpp"

int main(int argc, char** argv) {
  if (argc != 3) {
    fmt::print(stderr, "hamelin_c_calls: expected COUNT SEED\n");
    return 2;
  }
  const long count = std::atol(argv[1]);
  hamelin::Rng rng(std::strtoull(argv[2], nullptr, 10));
  long made = 0;
  for (std::string bytes(4000, '\0'); made < count; made += hamelin::fuzz::count_c_calls(bytes))
    for (char& byte : bytes) byte = static_cast<char>(rng.uniform(-128.0, 128.0));
  fmt::print("{} calls of the C interface\n", made);
  return 0;
}
