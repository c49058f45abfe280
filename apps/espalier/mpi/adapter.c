/* The binary's door to one MPI: compiled against its mpi.h into espalier_mpi_NAME.so, which the binary (and the Python
 * package) loads when it is started on several ranks. */
#include <mpi.h>

#include "espalier/mpi.h"

static int begun_here = 0;

/* The table for all ranks; begins MPI where nobody has. @returns 0, or an error number of MPI */
int espalier_mpi_adapter_begin(espalier_rank_functions* to) {
  int begun = 0, provided = 0, error = MPI_Initialized(&begun);
  if (error == MPI_SUCCESS && !begun) {
    error = MPI_Init_thread(NULL, NULL, MPI_THREAD_FUNNELED, &provided);
    begun_here = error == MPI_SUCCESS;
  }
  return error == MPI_SUCCESS ? espalier_mpi_functions(MPI_COMM_WORLD, to) : error;
}

/* The table for a communicator by its Fortran handle. */
int espalier_mpi_adapter_f2c(int comm, espalier_rank_functions* to) {
  return espalier_mpi_functions(MPI_Comm_f2c((MPI_Fint)comm), to);
}

void espalier_mpi_adapter_end(void) {
  if (begun_here) MPI_Finalize();
}
