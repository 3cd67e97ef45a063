#include "tree.hpp"

#include <array>
#include <limits>

namespace hamelin::search {

using Eigen::VectorXd;

namespace {

// Of nodes that are not there yet: never the nearest.
constexpr float nowhere = 1e18F;

}  // namespace

Tree::Tree(const VectorXd& weights, std::size_t nodes) : weights_(weights) {
  const auto n = static_cast<std::size_t>(weights.size());
  q_.reserve(n * nodes);
  weighted_.reserve(n * (nodes + block));
  parents_.reserve(nodes);
}

void Tree::clear() noexcept {
  q_.clear();
  weighted_.clear();
  parents_.clear();
}

int Tree::add(const VectorXd& q, int parent) {
  const std::size_t i = parents_.size(), n = static_cast<std::size_t>(q.size());
  if (i % block == 0) weighted_.resize(weighted_.size() + n * block, nowhere);
  float* const at = weighted_.data() + i / block * block * n + i % block;
  for (std::size_t j = 0; j < n; ++j) {
    const auto k = static_cast<Eigen::Index>(j);
    at[j * block] = static_cast<float>(weights_[k] * q[k]);
    q_.push_back(q[k]);
  }
  parents_.push_back(parent);
  return static_cast<int>(i);
}

int Tree::nearest(const VectorXd& q) const {
  const std::size_t n = static_cast<std::size_t>(q.size()),
                    blocks = (parents_.size() + block - 1) / block;
  std::array<float, block> best, square;
  std::array<std::size_t, block> where{};
  best.fill(std::numeric_limits<float>::max());
  const float* at = weighted_.data();
  for (std::size_t b = 0; b < blocks; ++b) {
    square.fill(0.0F);
    for (std::size_t j = 0; j < n; ++j, at += block) {
      const auto x = static_cast<float>(weights_[static_cast<Eigen::Index>(j)] *
                                        q[static_cast<Eigen::Index>(j)]);
      for (std::size_t l = 0; l < block; ++l) square[l] += (at[l] - x) * (at[l] - x);
    }
    for (std::size_t l = 0; l < block; ++l)
      if (square[l] < best[l]) best[l] = square[l], where[l] = b;
  }
  std::size_t nearest = 0;
  for (std::size_t l = 1; l < block; ++l)
    if (best[l] < best[nearest] || (best[l] == best[nearest] && where[l] < where[nearest]))
      nearest = l;
  return static_cast<int>(where[nearest] * block + nearest);
}

}  // namespace hamelin::search
