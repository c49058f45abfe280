/** \file
 * Solvers on the ranks of an MPI communicator: static functions that your compiler compiles against your own mpi.h, so
 * that the library, which was built without any MPI, fits every MPI.
 *
 *     #include <mpi.h>
 *     #include <espalier/mpi.h>
 *     ...
 *     espalier::Solver solver(espalier::on(MPI_COMM_WORLD), options);       // C++
 *     espalier_use_mpi(solver, MPI_COMM_WORLD, 300);                        // C, before the first analysis
 *     espalier_use_mpi_f2c(solver, fortran_communicator, 300);              // of an MPI_Fint
 *
 * All three are collective, and so are all calls of the solver. They work on a copy of the communicator
 * (MPI_Comm_dup), whose messages nobody else sees. MPI is called by the thread that calls the solver alone, so
 * MPI_Init suffices (MPI_THREAD_FUNNELED where you have threads of your own).
 */
#ifndef ESPALIER_MPI_H
#define ESPALIER_MPI_H

#include <limits.h>
#include <mpi.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined(OPEN_MPI) && OPEN_MPI && defined(__has_include)
#if __has_include(<mpi-ext.h>)
#include <mpi-ext.h>
#endif
#endif

#include "espalier/espalier.h"
#include "espalier/ranks.h"

#ifdef __cplusplus
extern "C" {
#endif

#define ESPALIER_MPI_TAG 1

/* A request of MPI in memory of its own; its place is what the library holds. */
static inline int espalier_mpi_begin_(int error, MPI_Request request, void** place) {
  MPI_Request* own;
  if (error != MPI_SUCCESS) return error;
  own = (MPI_Request*)malloc(sizeof *own);
  if (own == NULL) return MPI_ERR_NO_MEM;
  *own = request;
  *place = own;
  return 0;
}

static inline int espalier_mpi_send_(void* context, const void* data, size_t bytes, int32_t to, void** request) {
  MPI_Request own = MPI_REQUEST_NULL;
  int error;
  if (bytes > INT_MAX) return MPI_ERR_COUNT;
  error = MPI_Isend((void*)data, (int)bytes, MPI_BYTE, to, ESPALIER_MPI_TAG, *(MPI_Comm*)context, &own);
  return espalier_mpi_begin_(error, own, request);
}

static inline int espalier_mpi_probe_(void* context, int32_t* from, size_t* bytes) {
  int there = 0, count = 0, error;
  MPI_Status status;
  *from = -1;
  error = MPI_Iprobe(MPI_ANY_SOURCE, ESPALIER_MPI_TAG, *(MPI_Comm*)context, &there, &status);
  if (error != MPI_SUCCESS || !there) return error == MPI_SUCCESS ? 0 : error;
  error = MPI_Get_count(&status, MPI_BYTE, &count);
  *from = status.MPI_SOURCE;
  *bytes = (size_t)count;
  return error == MPI_SUCCESS ? 0 : error;
}

static inline int espalier_mpi_receive_(void* context, void* data, size_t bytes, int32_t from, void** request) {
  MPI_Request own = MPI_REQUEST_NULL;
  int error;
  if (bytes > INT_MAX) return MPI_ERR_COUNT;
  error = MPI_Irecv(data, (int)bytes, MPI_BYTE, from, ESPALIER_MPI_TAG, *(MPI_Comm*)context, &own);
  return espalier_mpi_begin_(error, own, request);
}

static inline int espalier_mpi_test_(void* context, void** request, int32_t* done) {
  int finished = 1, error = MPI_SUCCESS;
  (void)context;
  if (*request != NULL) error = MPI_Test((MPI_Request*)*request, &finished, MPI_STATUS_IGNORE);
  *done = finished && error == MPI_SUCCESS;
  if (*done) {
    free(*request);
    *request = NULL;
  }
  return error == MPI_SUCCESS ? 0 : error;
}

static inline void espalier_mpi_explain_(void* context, int error, char* text, size_t size) {
  char whole[MPI_MAX_ERROR_STRING + 1] = {0};
  int length = 0;
  (void)context;
  if (MPI_Error_string(error, whole, &length) != MPI_SUCCESS)
    (void)snprintf(whole, sizeof whole, "MPI error %d", error);
  if (size > 0) (void)snprintf(text, size, "%.*s", (int)(size - 1), whole);
}

/* MPIs that survive the death of a rank (ULFM) say which. */
static inline int32_t espalier_mpi_dead_rank_(void* context) {
#if defined(OMPI_HAVE_MPI_EXT_FTMPI) && OMPI_HAVE_MPI_EXT_FTMPI
  MPI_Comm comm = *(MPI_Comm*)context;
  MPI_Group dead, all;
  int32_t found = -1;
  int count = 0, first = 0, rank = MPI_UNDEFINED;
  if (MPIX_Comm_failure_ack(comm) != MPI_SUCCESS || MPIX_Comm_failure_get_acked(comm, &dead) != MPI_SUCCESS) return -1;
  if (MPI_Group_size(dead, &count) == MPI_SUCCESS && count > 0 && MPI_Comm_group(comm, &all) == MPI_SUCCESS) {
    if (MPI_Group_translate_ranks(dead, 1, &first, all, &rank) == MPI_SUCCESS && rank != MPI_UNDEFINED) found = rank;
    MPI_Group_free(&all);
  }
  MPI_Group_free(&dead);
  return found;
#else
  (void)context;
  return -1;
#endif
}

static inline void espalier_mpi_release_(void* context) {
  int ended = 0;
  if (MPI_Finalized(&ended) == MPI_SUCCESS && !ended) MPI_Comm_free((MPI_Comm*)context);
  free(context);
}

/** Fills the table from a copy of the communicator. Collective. @returns 0, or an error number of MPI. */
static inline int espalier_mpi_functions(MPI_Comm comm, espalier_rank_functions* to) {
  int begun = 0, ended = 0, rank = 0, ranks = 0, error;
  MPI_Comm* own;
  memset(to, 0, sizeof *to);
  if (MPI_Initialized(&begun) != MPI_SUCCESS || !begun || MPI_Finalized(&ended) != MPI_SUCCESS || ended)
    return MPI_ERR_OTHER; /* between MPI_Init and MPI_Finalize only */
  if (comm == MPI_COMM_NULL) return MPI_ERR_COMM;
  own = (MPI_Comm*)malloc(sizeof *own);
  if (own == NULL) return MPI_ERR_NO_MEM;
  error = MPI_Comm_dup(comm, own);
  if (error == MPI_SUCCESS) error = MPI_Comm_set_errhandler(*own, MPI_ERRORS_RETURN);
  if (error == MPI_SUCCESS) error = MPI_Comm_rank(*own, &rank);
  if (error == MPI_SUCCESS) error = MPI_Comm_size(*own, &ranks);
  if (error != MPI_SUCCESS) {
    free(own);
    return error;
  }
  to->size = sizeof *to;
  to->context = own;
  to->rank = rank;
  to->ranks = ranks;
  to->send = espalier_mpi_send_;
  to->probe = espalier_mpi_probe_;
  to->receive = espalier_mpi_receive_;
  to->test = espalier_mpi_test_;
  to->explain = espalier_mpi_explain_;
  to->dead_rank = espalier_mpi_dead_rank_;
  to->release = espalier_mpi_release_;
  return 0;
}

/** The solver of C works on the ranks of a communicator from its next analysis on. Collective.
 * @param patience  seconds after which a rank that sends nothing counts as lost; 0: 300 */
static inline int espalier_use_mpi(espalier_solver* solver, MPI_Comm comm, double patience) {
  espalier_rank_functions functions;
  if (solver == NULL || espalier_mpi_functions(comm, &functions) != 0) return ESPALIER_MISUSE;
  return espalier_use_ranks(solver, &functions, patience);
}

/** The same of a Fortran handle. */
static inline int espalier_use_mpi_f2c(espalier_solver* solver, MPI_Fint comm, double patience) {
  return espalier_use_mpi(solver, MPI_Comm_f2c(comm), patience);
}

#ifdef __cplusplus
}

#if __cplusplus >= 202002L
#include <string>

#include "espalier/ranks.hpp"

namespace espalier {

/// The ranks of a communicator. Collective.
/// @param patience  seconds after which a rank that sends nothing, while others wait, counts as lost
/// @throws Error(invalid_input) outside of MPI_Init and MPI_Finalize; Error(device_error)
inline Ranks on(MPI_Comm comm, double patience = Ranks::kPatience) {
  espalier_rank_functions functions;
  if (const int error = espalier_mpi_functions(comm, &functions); error != 0) {
    int begun = 0;
    if (MPI_Initialized(&begun) != MPI_SUCCESS || begun == 0)
      throw Error(StatusCode::invalid_input, "espalier::on: MPI has not begun; call MPI_Init first");
    char text[512] = {};
    espalier_mpi_explain_(nullptr, error, text, sizeof text);
    throw Error(StatusCode::invalid_input, std::string("espalier::on: ") + text);
  }
  return Ranks(functions, patience);
}

}  // namespace espalier
#endif
#endif

#endif
