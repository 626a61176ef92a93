// SPDX-License-Identifier: LGPL-2.1-or-later
// Helpers for the GstObject of an element.
#pragma once

#include <gst/gst.h>

namespace terrainseg {

/// Holds the object lock for its lifetime.
class ObjectLock {
 public:
  explicit ObjectLock(gpointer object) : object_(GST_OBJECT(object)) { GST_OBJECT_LOCK(object_); }
  ~ObjectLock() { GST_OBJECT_UNLOCK(object_); }
  ObjectLock(const ObjectLock&) = delete;
  ObjectLock& operator=(const ObjectLock&) = delete;

 private:
  GstObject* object_;
};

/// The pointer for GST_PTR_FORMAT, which the compiler checks as %p.
inline void* printable(void* object) {
  return object;
}

} // namespace terrainseg
