// SPDX-License-Identifier: LGPL-2.1-or-later
// What every element needs of its GstObject.
#pragma once

#include <gst/gst.h>

namespace terrainseg {

/// Holds the object lock for as long as it lives.
class ObjectLock {
 public:
  explicit ObjectLock(gpointer object) : object_(GST_OBJECT(object)) { GST_OBJECT_LOCK(object_); }
  ~ObjectLock() { GST_OBJECT_UNLOCK(object_); }
  ObjectLock(const ObjectLock&) = delete;
  ObjectLock& operator=(const ObjectLock&) = delete;

 private:
  GstObject* object_;
};

/// For GST_PTR_FORMAT, which the compiler takes for %p.
inline void* printable(void* object) {
  return object;
}

} // namespace terrainseg
