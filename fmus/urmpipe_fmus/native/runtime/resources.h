/* SPDX-License-Identifier: MIT */
/* The files in the FMU's folder of resources. */
#ifndef RESOURCES_H
#define RESOURCES_H

#include <stdio.h>

/* Open a file to be read. `folder` is a file URI as fmi2Instantiate is given it (file:///C:/a%20b), or a path, in
   UTF-8. NULL if it cannot be opened. */
FILE *open_resource(const char *folder, const char *name);

#endif
