// SPDX-License-Identifier: LGPL-2.1-or-later
// Tells ThreadSanitizer what GLib's and GStreamer's own synchronisation orders. Their libraries are not built
// with it: it sees pthread's mutexes through its interceptors, but GMutex and GCond sit on futexes, and the
// references that hand an object from thread to thread are counted by atomics that it does not see. Preloaded
// by tests/ci/tsan.sh; not instrumented itself.
#include <dlfcn.h>
#include <gst/gst.h>

extern "C" {
void __tsan_acquire(void* address);
void __tsan_release(void* address);
}

namespace {

/// What the name means in the library that this one stands in front of.
template <class Function> Function* real(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

/// Unlocks and locks again inside: the lock is given up in between.
template <class Wait> auto waiting(GMutex* mutex, Wait wait) {
  struct Given {
    GMutex* mutex;
    explicit Given(GMutex* m) : mutex(m) { __tsan_release(mutex); }
    ~Given() { __tsan_acquire(mutex); }
    Given(const Given&) = delete;
    Given& operator=(const Given&) = delete;
  } given(mutex);
  return wait();
}

/// The last reference frees: what all others did with the object is before that.
template <class Drop> auto dropping(gpointer object, Drop drop) {
  if (object) {
    __tsan_release(object);
    __tsan_acquire(object);
  }
  return drop();
}

} // namespace

#define REAL(NAME) static auto* const next = real<decltype(NAME)>(#NAME)

extern "C" {

void g_mutex_lock(GMutex* mutex) {
  REAL(g_mutex_lock);
  next(mutex);
  __tsan_acquire(mutex);
}
gboolean g_mutex_trylock(GMutex* mutex) {
  REAL(g_mutex_trylock);
  const gboolean locked = next(mutex);
  if (locked)
    __tsan_acquire(mutex);
  return locked;
}
void g_mutex_unlock(GMutex* mutex) {
  REAL(g_mutex_unlock);
  __tsan_release(mutex);
  next(mutex);
}
void g_cond_wait(GCond* cond, GMutex* mutex) {
  REAL(g_cond_wait);
  waiting(mutex, [&] { next(cond, mutex); });
}
gboolean g_cond_wait_until(GCond* cond, GMutex* mutex, gint64 end_time) {
  REAL(g_cond_wait_until);
  return waiting(mutex, [&] { return next(cond, mutex, end_time); });
}

void gst_mini_object_unref(GstMiniObject* object) {
  REAL(gst_mini_object_unref);
  dropping(object, [&] { next(object); });
}
void gst_object_unref(gpointer object) {
  REAL(gst_object_unref);
  dropping(object, [&] { next(object); });
}
#undef g_object_unref
void g_object_unref(gpointer object) {
  REAL(g_object_unref);
  dropping(object, [&] { next(object); });
}

// What comes back from a pool was dropped by another thread, by the function above.
GstFlowReturn gst_buffer_pool_acquire_buffer(GstBufferPool* pool, GstBuffer** buffer,
                                             GstBufferPoolAcquireParams* params) {
  REAL(gst_buffer_pool_acquire_buffer);
  const GstFlowReturn flow = next(pool, buffer, params);
  if (flow == GST_FLOW_OK)
    __tsan_acquire(*buffer);
  return flow;
}

// GLib's queue between threads: GstHarness holds what came out in it.
void g_async_queue_push(GAsyncQueue* queue, gpointer data) {
  REAL(g_async_queue_push);
  __tsan_release(queue);
  next(queue, data);
}
gpointer g_async_queue_pop(GAsyncQueue* queue) {
  REAL(g_async_queue_pop);
  const gpointer data = next(queue);
  __tsan_acquire(queue);
  return data;
}
gpointer g_async_queue_try_pop(GAsyncQueue* queue) {
  REAL(g_async_queue_try_pop);
  const gpointer data = next(queue);
  __tsan_acquire(queue);
  return data;
}
gpointer g_async_queue_timeout_pop(GAsyncQueue* queue, guint64 timeout) {
  REAL(g_async_queue_timeout_pop);
  const gpointer data = next(queue, timeout);
  __tsan_acquire(queue);
  return data;
}

// A bus holds messages in a queue without a lock.
gboolean gst_bus_post(GstBus* bus, GstMessage* message) {
  REAL(gst_bus_post);
  __tsan_release(bus);
  return next(bus, message);
}
GstMessage* gst_bus_timed_pop_filtered(GstBus* bus, GstClockTime timeout, GstMessageType types) {
  REAL(gst_bus_timed_pop_filtered);
  GstMessage* message = next(bus, timeout, types);
  __tsan_acquire(bus);
  return message;
}

} // extern "C"
