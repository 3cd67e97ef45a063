#include "hamelin/description/srdf.hpp"

#include "targets.hpp"

namespace hamelin::fuzz {

void srdf(std::string_view bytes) {
  const MemoryFile file(bytes);
  std::vector<description::DisabledPair> pairs;
  if (!accepts(file.path(), [&] { pairs = description::read_srdf(file.path()); })) return;
  for (const auto& pair : pairs)
    promise(!pair.link_a.empty() && !pair.link_b.empty() && pair.link_a != pair.link_b, "a pair is of two links");
  (void)accepts(file.path(), [&] {
    const auto known = description::read_srdf(file.path(), {"link1", "link2"});
    promise(known.size() == pairs.size(), "links that are there change nothing");
  });
}

}  // namespace hamelin::fuzz
