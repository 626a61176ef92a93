#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""The core computes with integers only: its object code has no floating-point arithmetic or conversion.

usage: check_integer_core.py OBJDUMP ARCHIVE COMPILER...

Disassembles ARCHIVE and fails on an instruction that computes with, compares or converts floating-point
numbers. Moves, shuffles, blends and bitwise operations are fine whatever their name: compilers move bytes in
vector registers with them. Before that the check proves that it can fail, on a float function that it compiles
with COMPILER, and that it passes integer code.
"""
import os
import re
import subprocess
import sys
import tempfile

KIND = r'(ss|sd|ps|pd|sh|ph)'
FORBIDDEN = {
    'x86': re.compile(
        rf'v?(add|sub|mul|div|sqrt|rsqrt(14|28)?|rcp(14|28)?|max|min|hadd|hsub|addsub|dp|round|rndscale|range|reduce|'
        rf'getexp|getmant|scalef|fixupimm|fpclass|exp2){KIND}[xyz]?'
        rf'|v?u?comis[sdh]|v?cmp\w*{KIND}|v?cvt\w+|vfn?m(add|sub)\w+|f\w+'),
    'aarch64': re.compile(r'f(?!mov)\w+|[su]cvtf|bf(dot|mmla|mlal)\w*'),
}
LINE = re.compile(r'^\s*[0-9a-f]+:\t(?:(?:rep[nz]*|lock|notrack|bnd|data16|\{\w+\}) )*([a-z][\w.]*)')
FLOATS = 'float scaled(const int* values, int n) { float s = 0; for (int i = 0; i < n; ++i) s += values[i] * 0.5f; return s; }'
INTEGERS = ('struct Block { unsigned char bytes[64]; }; void copy(Block* to, const Block* from) { *to = *from; } '
            'int sum(const int* values, int n) { int s = 0; for (int i = 0; i < n; ++i) s += values[i] * 3 / 7; return s; }')


def disassembly(objdump, path):
    return subprocess.run([objdump, '-d', '--no-show-raw-insn', path], check=True, capture_output=True, text=True).stdout


def findings(text):
    """(function, instruction) of every forbidden instruction, and how many instructions were looked at."""
    machine = 'aarch64' if 'aarch64' in text else 'x86'
    function, found, looked_at = '?', [], 0
    for line in text.splitlines():
        header = re.match(r'^[0-9a-f]+ <(.+)>:$', line)
        if header:
            function = header.group(1)
            continue
        instruction = LINE.match(line)
        if not instruction:
            continue
        looked_at += 1
        if FORBIDDEN[machine].fullmatch(instruction.group(1)):
            found.append((function, line.split('\t', 1)[1].strip()))
    return found, looked_at


def compiled(compiler, source, folder):
    cpp, obj = os.path.join(folder, 'probe.cpp'), os.path.join(folder, 'probe.o')
    with open(cpp, 'w') as file:
        file.write(source + '\n')
    subprocess.run([*compiler, '-O2', '-c', cpp, '-o', obj], check=True)
    return obj


def main():
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    objdump, archive, compiler = sys.argv[1], sys.argv[2], sys.argv[3:]
    with tempfile.TemporaryDirectory() as folder:
        caught, _ = findings(disassembly(objdump, compiled(compiler, FLOATS, folder)))
        wrong, looked_at = findings(disassembly(objdump, compiled(compiler, INTEGERS, folder)))
    if len(caught) < 2 or wrong or looked_at == 0:
        sys.exit(f'check_integer_core: the check itself is broken: caught {caught} in float code, {wrong} in integer code')
    found, looked_at = findings(disassembly(objdump, archive))
    if looked_at < 1000:
        sys.exit(f'check_integer_core: only {looked_at} instructions in {archive}: is it the core?')
    for function, instruction in found[:40]:
        print(f'{function}: {instruction}')
    if found:
        sys.exit(f'check_integer_core: {len(found)} floating-point instructions among {looked_at}')
    print(f'{looked_at} instructions, none of them floating point')


if __name__ == '__main__':
    main()
