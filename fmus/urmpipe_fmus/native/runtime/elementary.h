/* SPDX-License-Identifier: MIT */
/* The elementary functions, computed alike on every platform.

   C libraries differ in the last bits of sin, exp and their like, and so would an FMU on Linux and on Windows. These
   use + - * / and sqrt only, which IEEE 754 defines to the last bit (compile without contracting a * b + c, and
   without -ffast-math), and what is exact in any library: floor, ldexp, fmod. They are within 3 units in the last
   place. For angles above 1.6e6 rad sine, cosine and tangent are the library's own. */
#ifndef ELEMENTARY_H
#define ELEMENTARY_H

double sin_of(double x);
double cos_of(double x);
double tan_of(double x);
double asin_of(double x);
double acos_of(double x);
double atan_of(double x);
double atan2_of(double y, double x);
double exp_of(double x);
double expm1_of(double x);
double log_of(double x);
double log1p_of(double x);
double sinh_of(double x);
double cosh_of(double x);
double tanh_of(double x);
double asinh_of(double x);
double acosh_of(double x);
double atanh_of(double x);
double hypot_of(double x, double y);
double pow_of(double x, double y);

/* Functions of NumPy that C does not have: sign, minimum and maximum; a NaN goes through. */
double sign_of(double x);
double lesser(double x, double y);
double greater(double x, double y);

#endif
