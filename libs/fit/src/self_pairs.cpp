#include "hamelin/fit/self_pairs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/description/urdf_geometry.hpp"

namespace hamelin::fit {

namespace {

using Pair = std::pair<std::size_t, std::size_t>;  // indices of links, the first below the second

// The links of a URDF as a graph: which links a joint connects, and which have shapes.
class Links {
 public:
  Links(const std::filesystem::path& urdf, const Json& sidecar) {
    const auto geometry = description::read_urdf_geometry(urdf);
    for (const description::LinkGeometry& link : geometry) {
      index_.emplace(link.name, names.size());
      names.push_back(link.name);
    }
    joined_.resize(names.size());
    leaf_.assign(names.size(), true);
    for (const description::LinkGeometry& link : geometry) {
      if (link.parent.empty()) continue;
      const std::size_t a = index_.at(link.name), b = index_.at(link.parent);
      joined_[a].push_back(b);
      joined_[b].push_back(a);
      leaf_[b] = false;
    }
    has_shapes_.assign(names.size(), false);
    for (const char* key : {"links", "capsules"})
      if (sidecar.contains(key))
        for (const auto& [name, list] : sidecar[key].items())
          if (const auto at = index_.find(name); at != index_.end() && !list.empty())
            has_shapes_[at->second] = true;
  }

  [[nodiscard]] Pair pair(const std::string& a, const std::string& b) const {
    return std::minmax({index_.at(a), index_.at(b)});
  }

  [[nodiscard]] std::vector<std::string> leaves() const {
    std::vector<std::string> out;
    for (std::size_t i = 0; i < names.size(); ++i)
      if (leaf_[i]) out.push_back(names[i]);
    return out;
  }

  // Pairs of links with shapes that are connected directly or across links without shapes.
  [[nodiscard]] std::set<Pair> adjacent() const {
    std::set<Pair> out;
    for (std::size_t start = 0; start < names.size(); ++start) {
      if (!has_shapes_[start]) continue;
      std::set<std::size_t> seen{start};
      std::vector<std::size_t> open{start};
      while (!open.empty()) {
        const std::size_t at = open.back();
        open.pop_back();
        for (const std::size_t next : joined_[at]) {
          if (!seen.insert(next).second) continue;
          if (has_shapes_[next])
            out.insert(std::minmax({start, next}));
          else
            open.push_back(next);
        }
      }
    }
    return out;
  }

  std::vector<std::string> names;

 private:
  std::map<std::string, std::size_t> index_;
  std::vector<std::vector<std::size_t>> joined_;
  std::vector<bool> leaf_, has_shapes_;
};

}  // namespace

SelfPairs pairs_to_disable(const std::filesystem::path& urdf, const Json& sidecar,
                           const std::optional<std::string>& tip, const SelfCheckOptions& options) {
  SelfPairs out;
  const Links links(urdf, sidecar);
  std::map<Pair, std::string> reasons;  // empty: none in the chain to some leaf
  for (const std::string& leaf : tip ? std::vector<std::string>{*tip} : links.leaves()) {
    description::RobotOptions robot;
    robot.tip = leaf;
    robot.sidecar = sidecar;
    try {
      const SelfCheck check = check_self(description::read_robot(urdf, robot), {}, options);
      for (const PartPair& parts : check.pairs) {
        const std::string reason = contact_reason(parts, check.samples);
        const auto [before, is_new] =
            reasons.emplace(links.pair(parts.part_a, parts.part_b), reason);
        if (!is_new && reason.empty()) before->second.clear();
      }
    } catch (const Error& error) {
      if (tip) throw;
      out.notes.push_back(fmt::format("self-collision in the chain to '{}' is not sampled: {}",
                                      leaf, error.what()));
    }
  }
  for (const Pair& pair : links.adjacent()) reasons[pair] = "Adjacent";
  for (const auto& [pair, reason] : reasons)
    if (!reason.empty())
      out.pairs.push_back({links.names[pair.first], links.names[pair.second], reason, 0});
  return out;
}

std::vector<std::pair<std::string, std::string>> SelfPairs::names() const {
  std::vector<std::pair<std::string, std::string>> out;
  for (const auto& pair : pairs) out.emplace_back(pair.link_a, pair.link_b);
  return out;
}

SelfPairs sidecar_pairs(const std::filesystem::path& urdf, const RobotFit& fitted,
                        const std::optional<std::filesystem::path>& srdf,
                        const std::optional<std::string>& tip, const SelfCheckOptions& options) {
  SelfPairs out;
  if (srdf) {
    std::vector<std::string> links;
    for (const auto& link : description::read_urdf_geometry(urdf)) links.push_back(link.name);
    out.pairs = description::read_srdf(*srdf, links);
    for (auto& pair : out.pairs) pair.reason = "SRDF";
  }
  const SelfPairs needed = pairs_to_disable(urdf, sidecar_json(fitted, "", {}), tip, options);
  for (const auto& pair : needed.pairs) {
    const bool listed = std::any_of(out.pairs.begin(), out.pairs.end(), [&](const auto& old) {
      return std::minmax(old.link_a, old.link_b) == std::minmax(pair.link_a, pair.link_b);
    });
    if (!listed) out.pairs.push_back(pair);
  }
  out.notes = needed.notes;
  return out;
}

}  // namespace hamelin::fit
