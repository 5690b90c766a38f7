/* SPDX-License-Identifier: MIT */
/* The files in the FMU's folder of resources: where they are, by a file URI. */
#include "resources.h"

#include <string.h>

/* Of Windows, whose names must not meet those of model.h: this file knows nothing of the model. */
#if defined _WIN32
#include <windows.h>
#endif

#define LONGEST_PATH 4096

static int hex_digit(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
}

/* Write a text with each %XX as the byte it stands for; 0 if there is no room for it. */
static int unquote(char path[], size_t room, const char *text) {
    size_t length = 0;
    for (; *text; text++) {
        if (length + 1 >= room) return 0;
        int high = *text == '%' ? hex_digit(text[1]) : -1;
        int low = high >= 0 ? hex_digit(text[2]) : -1;
        path[length++] = low >= 0 ? (char)(16 * high + low) : *text;
        if (low >= 0) text += 2;
    }
    path[length] = '\0';
    return 1;
}

/* The part of a file URI that is the path. */
static const char *after_host(const char *uri) {
    uri += strlen("file:");
    if (strncmp(uri, "//localhost/", 12) == 0) return uri + 11;
    if (strncmp(uri, "///", 3) == 0) return uri + 2;
    return uri; /* file:/path, or file://server/path: with both slashes it is a network path of Windows */
}

/* Write the path of a file in a folder; 0 if it is too long. A folder that is no URI is a path already. */
static int path_of(char path[], const char *folder, const char *name) {
    if (strncmp(folder, "file:", 5) == 0) {
        if (!unquote(path, LONGEST_PATH, after_host(folder))) return 0;
    } else {
        if (strlen(folder) >= LONGEST_PATH) return 0;
        strcpy(path, folder);
    }
    size_t length = strlen(path);
    while (length && path[length - 1] == '/') length--;
    if (length + 1 + strlen(name) >= LONGEST_PATH) return 0;
    path[length] = '/';
    strcpy(path + length + 1, name);
    return 1;
}

FILE *open_resource(const char *folder, const char *name) {
    char path[LONGEST_PATH];
    if (!path_of(path, folder, name)) return NULL;
#if defined _WIN32
    wchar_t wide[LONGEST_PATH];
    if (path[0] == '/' && path[1] && path[2] == ':') memmove(path, path + 1, strlen(path)); /* /C:/folder */
    if (!MultiByteToWideChar(CP_UTF8, MB_ERR_INVALID_CHARS, path, -1, wide, LONGEST_PATH)) return NULL;
    return _wfopen(wide, L"rb");
#else
    return fopen(path, "rb");
#endif
}
