#!/bin/bash
# Slurm: 16384² elements take some 90 GB, so 4 nodes of 32 GB; a rank a node, its cores as threads.
#SBATCH --job-name=press
#SBATCH --nodes=4
#SBATCH --ntasks-per-node=1
#SBATCH --cpus-per-task=64
#SBATCH --time=01:00:00

# The cluster's own MPI: mpi4py runs on any. Where python -m mpi4py starts the script, an error on
# one rank ends the others, which would wait for it. The script shares its work among the threads
# of a rank itself: BLAS is not to take the same cores.
module load python openmpi
export OMP_NUM_THREADS=$SLURM_CPUS_PER_TASK OPENBLAS_NUM_THREADS=1
srun --cpus-per-task="$SLURM_CPUS_PER_TASK" python -m mpi4py press_on_a_cluster.py
