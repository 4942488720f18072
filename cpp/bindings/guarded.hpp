// An object that changes, as Python holds it. The rule: one call at a time. A call that finds the object in another
// call, which runs it without the GIL, is refused at once; nobody waits, so nothing can deadlock.
#pragma once

#include <atomic>
#include <stdexcept>
#include <string>
#include <utility>

namespace mgdd::bindings {

/// Becomes mgdd.errors.InUseError.
struct InUse : std::runtime_error {
  explicit InUse(const std::string& name)
      : std::runtime_error(name +
                           " is in use by a call in another thread: wait for that call, or give each thread its own "
                           "copy (copy.deepcopy)") {}
};

template <class T>
class Guarded {
 public:
  Guarded(const char* name, T object) : name_(name), object_(std::move(object)) {}
  Guarded(Guarded&& other) noexcept : name_(other.name_), object_(std::move(other.object_)) {}

  /// The object for the life of one call. Convert the arguments first: no Python code may run while it is held.
  template <class Object>
  class Use {
   public:
    Use(const Guarded& owner, Object& object) : owner_(owner), object_(object) {
      if (owner_.busy_.test_and_set(std::memory_order_acquire)) throw InUse(owner_.name_);
    }
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;
    ~Use() { owner_.busy_.clear(std::memory_order_release); }

    Object& operator*() const noexcept { return object_; }
    Object* operator->() const noexcept { return &object_; }

   private:
    const Guarded& owner_;
    Object& object_;
  };

  Use<T> use() { return {*this, object_}; }
  Use<const T> use() const { return {*this, object_}; }

  /// For what stays as it was made, such as settings.
  const T& constant() const noexcept { return object_; }

 private:
  const char* name_;
  mutable std::atomic_flag busy_{};
  T object_;
};

}  // namespace mgdd::bindings
