#include "hamelin/description/srdf.hpp"

#include "targets.hpp"

namespace hamelin::fuzz {

void srdf(std::string_view bytes) {
  const MemoryFile file(bytes);
  std::vector<description::DisabledPair> pairs;
  if (!accepts(file.path(), [&] { pairs = description::read_srdf(file.path()); })) return;
  for (const auto& pair : pairs)
    require(!pair.link_a.empty() && !pair.link_b.empty() && pair.link_a != pair.link_b,
            "a pair names two different links");
  (void)accepts(file.path(), [&] {
    const auto known = description::read_srdf(file.path(), {"link1", "link2"});
    require(known.size() == pairs.size(),
            "a list of known links does not change the number of pairs");
  });
}

}  // namespace hamelin::fuzz
