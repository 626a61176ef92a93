#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""examples/fleet/kubernetes.yaml against a schema of the fields it may use, and what only an API server would find."""
import copy
import json
import os
import pathlib
import sys

import jsonschema
import yaml

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
from tap import equal, main  # noqa: E402

SCHEMA = json.loads((HERE / 'kubernetes_job.schema.json').read_text())
JOB = yaml.safe_load((pathlib.Path(os.environ['TERRAINSEG_EXAMPLES']) / 'fleet' / 'kubernetes.yaml').read_text())
CASES = []


def case(function):
    CASES.append(function)
    return function


def flaws(job):
    """What is wrong with it, field by field, and between fields."""
    found = [f'{error.json_path}: {error.message}' for error in jsonschema.Draft202012Validator(SCHEMA).iter_errors(job)]
    if found:
        return found
    spec, pod = job['spec'], job['spec']['template']['spec']
    rules = spec.get('podFailurePolicy', {}).get('rules', [])
    names = [container['name'] for container in pod['containers']]
    volumes = [volume['name'] for volume in pod.get('volumes', [])]
    if len(set(names)) < len(names) or len(set(volumes)) < len(volumes):
        found.append('two of a name')
    if rules and pod['restartPolicy'] != 'Never':
        found.append('a podFailurePolicy needs restartPolicy: Never')
    if spec.get('completionMode') == 'Indexed' and not spec.get('completions'):
        found.append('an indexed Job needs completions')
    for codes in (rule['onExitCodes'] for rule in rules if 'onExitCodes' in rule):
        if codes.get('containerName', names[0]) not in names:
            found.append(f'no container {codes["containerName"]}')
        if codes['values'] != sorted(codes['values']):
            found.append('exit codes must rise')
    for container in pod['containers']:
        mounts = container.get('volumeMounts', [])
        found += [f'no volume {mount["name"]}' for mount in mounts if mount['name'] not in volumes]
        if len({mount['mountPath'] for mount in mounts}) < len(mounts):
            found.append('two mounts at one place')
        resources = container.get('resources', {})
        if not set(resources.get('requests', {})) <= set(resources.get('limits', {})):
            found.append('a request without a limit: the pod is not bounded')
    return found


@case
def the_job_is_sound(folder):
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    equal(flaws(JOB), [])


@case
def the_job_does_what_the_page_says(folder):
    spec, container = JOB['spec'], JOB['spec']['template']['spec']['containers'][0]
    env = {each['name']: each['value'] for each in container['env']}
    equal(env['TERRAINSEG_SHARD_COUNT'], str(spec['completions']), 'as many shards as completions')
    codes = {code: rule['action'] for rule in spec['podFailurePolicy']['rules'] for code in rule.get('onExitCodes', {}).get('values', [])}
    assert 75 not in codes, '75 is tried again'
    equal([codes.get(code) for code in (2, 3, 4)], ['FailJob'] * 3, 'what does not become better')
    written = [mount['mountPath'] for mount in container['volumeMounts']]
    assert container['securityContext']['readOnlyRootFilesystem'] and '/tmp' in written and '/data' in written, written


def changed(path, value):
    """The job with one thing other than it is; None takes it away."""
    job = copy.deepcopy(JOB)
    *way, last = path
    at = job
    for step in way:
        at = at[step]
    if value is None:
        del at[last]
    else:
        at[last] = value
    return job


@case
def each_mistake_is_found(folder):
    pod, rules = ('spec', 'template', 'spec'), ('spec', 'podFailurePolicy', 'rules')
    container = (*pod, 'containers', 0)
    for path, value in [
            (('apiVersion',), 'batch/v1beta1'), (('kind',), 'CronJob'), (('metadata', 'generateName'), None), (('metadata', 'generateName'), 'Terrain_'),
            (('spec', 'completionmode'), 'Indexed'), (('spec', 'completionMode'), 'indexed'), (('spec', 'completions'), '8'), (('spec', 'completions'), None),
            (('spec', 'parallelism'), -1), (('spec', 'backoffLimit'), 2.5), (('spec', 'template'), None), (('spec', 'selector'), {}),
            ((*rules, 0, 'action'), 'Fail'), ((*rules, 0, 'action'), None), ((*rules, 0, 'onExitCodes', 'operator'), 'Equals'),
            ((*rules, 0, 'onExitCodes', 'values'), [0, 2]), ((*rules, 0, 'onExitCodes', 'values'), ['2']), ((*rules, 0, 'onExitCodes', 'values'), [4, 2]),
            ((*rules, 0, 'onExitCodes', 'values'), [256]), ((*rules, 0, 'onExitCodes', 'values'), []), ((*rules, 0, 'onExitCodes', 'containerName'), 'other'),
            ((*rules, 1, 'onExitCodes'), {'operator': 'In', 'values': [5]}), ((*rules, 1, 'onPodConditions', 0, 'status'), True),
            ((*pod, 'restartPolicy'), 'OnFailure'), ((*pod, 'restartPolicy'), 'Always'), ((*pod, 'restartPolicy'), None), ((*pod, 'containers'), []),
            ((*pod, 'securityContext', 'runAsNonRoot'), 'yes'), ((*pod, 'securityContext', 'runAsUser'), '1000'),
            ((*container, 'image'), None), ((*container, 'name'), 'Process'), ((*container, 'command'), '/bin/sh'), ((*container, 'args', 0), 3),
            ((*container, 'env', 0, 'value'), 8), ((*container, 'env', 0, 'name'), None), ((*container, 'enviroment'), []),
            ((*container, 'resources', 'requests', 'memory'), '512 MB'), ((*container, 'resources', 'limits', 'cpu'), 'one'),
            ((*container, 'resources', 'limits', 'memory'), None), ((*container, 'resources', 'limit'), {}),
            ((*container, 'securityContext', 'capabilities', 'drop'), 'ALL'), ((*container, 'volumeMounts', 0, 'mountPath'), 'data'),
            ((*container, 'volumeMounts', 0, 'mountPath'), '/tmp'), ((*container, 'volumeMounts', 0, 'name'), 'elsewhere'),
            ((*pod, 'volumes', 0, 'persistentVolumeClaim', 'claimName'), None), ((*pod, 'volumes', 0, 'emptyDir'), {}), ((*pod, 'volumes', 1, 'emptyDir'), None)]:
        assert flaws(changed(path, value)), f'{".".join(map(str, path))} = {value!r} is not noticed'


main(CASES)
