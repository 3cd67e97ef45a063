// Compiled once for each instruction set; see dynamics/kernel/lanes.hpp on what may be used here.
// Unlike other kernels, this one is compiled without fused multiply-add: all instruction sets give
// the same bits.
#include "hamelin/scene/kernel/box_tree.hpp"
#include "tree_candidates.hpp"
#include "tree_query.hpp"
#include "tree_search.hpp"

namespace hamelin::scene::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

namespace {

bool nearest(const Tree& tree, const double* p, const double* q, double limit,
             Found& found) noexcept {
  return q == nullptr ? nearest_of(tree, Point(tree, p), limit, found)
                      : nearest_of(tree, Segment(tree, p, q), limit, found);
}

int nearest_distinct(const Tree& tree, const double* p, const double* q, double limit,
                     double cone_cosine, QueueEntry* queue, Found* out, int count) noexcept {
  return q == nullptr
             ? nearest_distinct_of(tree, Point(tree, p), limit, cone_cosine, queue, out, count)
             : nearest_distinct_of(tree, Segment(tree, p, q), limit, cone_cosine, queue, out,
                                   count);
}

int gather(const Tree& tree, const double* p, const double* q, double limit, TreeNode* nodes,
           int nodes_max) noexcept {
  return q == nullptr ? gather_of(tree, Point(tree, p), limit, nodes, nodes_max)
                      : gather_of(tree, Segment(tree, p, q), limit, nodes, nodes_max);
}

int nearest_distinct_among(const Tree& tree, const TreeNode* nodes, int node_count, const double* p,
                           const double* q, double limit, double cone_cosine, float* bounds,
                           Found* out, int count) noexcept {
  return q == nullptr ? nearest_distinct_among_of(tree, nodes, node_count, Point(tree, p), limit,
                                                  cone_cosine, bounds, out, count)
                      : nearest_distinct_among_of(tree, nodes, node_count, Segment(tree, p, q),
                                                  limit, cone_cosine, bounds, out, count);
}

}  // namespace

extern const TreeKernels tree_kernels;
constexpr TreeKernels tree_kernels{nearest, nearest_distinct, gather, nearest_distinct_among};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::scene::kernel
