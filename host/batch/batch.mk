# SPDX-License-Identifier: GPL-3.0-or-later

PACKAGES_TEST += slurmctld slurmd slurm-client munge
