#pragma once
#include <atomic>
#include <memory>
#include <utility>

namespace hamelin::control {

/// Hands the newest of a series of values from writers to one reader. The reader's take() is
/// wait-free but for one other thread that may reclaim values at the same moment; it neither
/// allocates nor frees nor locks. Values that are replaced before they were taken are skipped.
/// Memory is freed by writers only: they reclaim what the reader has handed back.
template <class T>
class Newest {
 public:
  explicit Newest(std::unique_ptr<T> first) : current_(new Node{std::move(first), nullptr}) {}
  Newest(const Newest&) = delete;
  Newest& operator=(const Newest&) = delete;
  ~Newest() {
    delete incoming_.load();
    reclaim();
    delete current_;
  }

  /// Publishes a value. One writer at a time: callers lock among themselves.
  void publish(std::unique_ptr<T> value) {
    delete incoming_.exchange(new Node{std::move(value), nullptr}, std::memory_order_acq_rel);
    reclaim();
  }

  /// The newest published value, which belongs to the reader until its next call of take(). For one
  /// thread.
  [[nodiscard]] T& take() noexcept {
    if (incoming_.load(std::memory_order_relaxed) == nullptr) return *current_->value;
    Node* const fresh = incoming_.exchange(nullptr, std::memory_order_acq_rel);
    if (fresh == nullptr) return *current_->value;
    Node* const old = std::exchange(current_, fresh);
    old->next = returned_.load(std::memory_order_relaxed);
    while (!returned_.compare_exchange_weak(old->next, old, std::memory_order_release,
                                            std::memory_order_relaxed)) {
    }
    return *current_->value;
  }

 private:
  struct Node {
    std::unique_ptr<T> value;
    Node* next;
  };

  void reclaim() noexcept {
    Node* node = returned_.exchange(nullptr, std::memory_order_acquire);
    while (node != nullptr) delete std::exchange(node, node->next);
  }

  std::atomic<Node*> incoming_{nullptr};  ///< published and not yet taken
  std::atomic<Node*> returned_{nullptr};  ///< list of nodes that the reader has done with
  Node* current_;                         ///< the reader's
  static_assert(std::atomic<Node*>::is_always_lock_free);
};

}  // namespace hamelin::control
