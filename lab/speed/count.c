// SPDX-License-Identifier: LGPL-2.1-or-later
// A plugin of qemu-user (7.2, plugin interface 1): counts the instructions of a program by symbol and writes
// a line "COUNT SYMBOL" for each symbol to the file of the argument out=FILE.
//
// Debian has no package with qemu's header, so the functions that are used are declared here.
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct qemu_plugin_tb;
struct qemu_plugin_insn;
size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb* block);
struct qemu_plugin_insn* qemu_plugin_tb_get_insn(const struct qemu_plugin_tb* block, size_t index);
const char* qemu_plugin_insn_symbol(const struct qemu_plugin_insn* instruction);
void qemu_plugin_register_vcpu_tb_trans_cb(uint64_t id, void (*call)(uint64_t, struct qemu_plugin_tb*));
void qemu_plugin_register_vcpu_tb_exec_cb(struct qemu_plugin_tb* block, void (*call)(unsigned, void*),
                                          int flags, void* data);
void qemu_plugin_register_atexit_cb(uint64_t id, void (*call)(uint64_t, void*), void* data);

__attribute__((visibility("default"))) int qemu_plugin_version = 1;

// A translated block; one thread runs.
struct block {
  const char* symbol;
  uint64_t instructions, runs;
  struct block* next;
};
static struct block* blocks;
static char path[4096];

static void ran(unsigned processor, void* data) {
  (void)processor;
  ++((struct block*)data)->runs;
}

static void translated(uint64_t id, struct qemu_plugin_tb* code) {
  (void)id;
  const char* symbol = qemu_plugin_insn_symbol(qemu_plugin_tb_get_insn(code, 0));
  struct block* block = calloc(1, sizeof *block);
  if (!block)
    abort();
  block->symbol = strdup(symbol ? symbol : "?");
  block->instructions = qemu_plugin_tb_n_insns(code);
  block->next = blocks;
  blocks = block;
  qemu_plugin_register_vcpu_tb_exec_cb(code, ran, 0, block);
}

static void write_counts(uint64_t id, void* data) {
  (void)id;
  (void)data;
  FILE* file = fopen(path, "w");
  if (!file)
    abort();
  for (const struct block* block = blocks; block; block = block->next)
    fprintf(file, "%llu %s\n", (unsigned long long)(block->instructions * block->runs), block->symbol);
  fclose(file);
}

__attribute__((visibility("default"))) int qemu_plugin_install(uint64_t id, const void* info, int count,
                                                               char** arguments) {
  (void)info;
  for (int i = 0; i < count; ++i)
    if (strncmp(arguments[i], "out=", 4) == 0)
      snprintf(path, sizeof path, "%s", arguments[i] + 4);
  if (!path[0])
    return 1;
  qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
  qemu_plugin_register_atexit_cb(id, write_counts, NULL);
  return 0;
}
