// SPDX-License-Identifier: LGPL-2.1-or-later
// The C++ state of an element in the memory of its GObject. The init function of an instance cannot fail, so
// the constructor of the state must not allocate.
#pragma once

#include <glib-object.h>

#include <memory>
#include <new>
#include <type_traits>

namespace terrainseg {

/// The member `state` of an instance struct. GObject zeroes the memory and calls no constructor: call make()
/// in init and set finalize_state() in class_init.
template <class State> class InstanceState {
 public:
  void make() noexcept {
    static_assert(std::is_nothrow_default_constructible_v<State>, "an exception in init ends the program");
    static_assert(sizeof(State) <= 32768, "GObject counts the size of an instance in 16 bits");
    new (bytes_) State;
  }
  State& operator*() noexcept { return *std::launder(reinterpret_cast<State*>(bytes_)); }
  State* operator->() noexcept { return &**this; }

 private:
  alignas(State) unsigned char bytes_[sizeof(State)];
};

/// Finalize function of such a class; `parent_class` is defined by G_DEFINE_TYPE.
template <class Instance, gpointer& parent_class> void finalize_state(GObject* object) {
  std::destroy_at(&*reinterpret_cast<Instance*>(object)->state);
  G_OBJECT_CLASS(parent_class)->finalize(object);
}

} // namespace terrainseg
