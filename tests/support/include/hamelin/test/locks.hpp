#pragma once
#include <dlfcn.h>
#include <pthread.h>

/// Counts the calls of a test program, its plugins and its shared libraries that lock a mutex, a
/// read-write lock or a spin lock; a wait on a condition needs a mutex first. This header replaces
/// these functions in the whole program, so include it in exactly one source file. Where
/// allocations are not counted, locks are not either.

namespace hamelin::test {

inline thread_local long lock_count = 0;

/// Locks taken by f() on this thread.
template <class F>
long locks_in(F&& f) {
  const long before = lock_count;
  f();
  return lock_count - before;
}

}  // namespace hamelin::test

// As for allocations: sanitizers intercept these functions, and other C libraries name them
// otherwise.
#if defined(__GLIBC__) && !defined(HAMELIN_SANITIZED)

// Counts a call and passes it on to the C library.
#define HAMELIN_COUNTED_LOCK(function, type)                                                 \
  extern "C" [[gnu::visibility("default")]] int function(type* lock) noexcept {              \
    static auto* const next = reinterpret_cast<int (*)(type*)>(dlsym(RTLD_NEXT, #function)); \
    ++hamelin::test::lock_count;                                                             \
    return next(lock);                                                                       \
  }                                                                                          \
  static_assert(true, "")
HAMELIN_COUNTED_LOCK(pthread_mutex_lock, pthread_mutex_t);
HAMELIN_COUNTED_LOCK(pthread_mutex_trylock, pthread_mutex_t);
HAMELIN_COUNTED_LOCK(pthread_rwlock_rdlock, pthread_rwlock_t);
HAMELIN_COUNTED_LOCK(pthread_rwlock_wrlock, pthread_rwlock_t);
#undef HAMELIN_COUNTED_LOCK
extern "C" [[gnu::visibility("default")]] int pthread_spin_lock(pthread_spinlock_t* lock) noexcept {
  using Function = int (*)(pthread_spinlock_t*);
  static auto* const next = reinterpret_cast<Function>(dlsym(RTLD_NEXT, "pthread_spin_lock"));
  ++hamelin::test::lock_count;
  return next(lock);
}

#endif
