/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <math.h>
#include <stdarg.h>
#include <string.h>

#include "host/archive/private.h"

#define REBUILD "'droptower series --archive %.300s --rebuild' makes it again from the raw files"

int sql_refuse(struct archive *archive)
{
	const char *why = sqlite3_errmsg(archive->index), *folder = archive->folder;

	switch (sqlite3_errcode(archive->index) & 0xff) {
	case SQLITE_CORRUPT:
	case SQLITE_NOTADB:
	case SQLITE_ERROR: /* every statement is right: the schema is not ours */
		return archive_refuse(archive, DT_E_CORRUPT, "%.200s/index.sqlite: damaged: %.80s; " REBUILD,
		                      folder, why, folder);
	case SQLITE_FULL:
		return archive_refuse(archive, DT_E_FULL, "%.300s: the disk is full", folder);
	case SQLITE_BUSY:
	case SQLITE_LOCKED:
		return archive_refuse(archive, DT_E_TIMEOUT,
		                      "%.300s: another program holds the index, expected it to end within "
		                      "seconds",
		                      folder);
	case SQLITE_READONLY:
	case SQLITE_CANTOPEN:
		return archive_refuse(archive, DT_E_SYSTEM,
		                      "%.300s/index.sqlite: %s, expected a folder that can be written",
		                      folder, why);
	default:
		return archive_refuse(archive, DT_E_SYSTEM, "%.300s/index.sqlite: %s", folder, why);
	}
}

static int bind_one(sqlite3_stmt *statement, int column, char type, va_list *values)
{
	double number;

	switch (type) {
	case 'i':
		return sqlite3_bind_int64(statement, column, va_arg(*values, int64_t));
	case 'd':
		number = va_arg(*values, double);
		return isnan(number) ? sqlite3_bind_null(statement, column)
		                     : sqlite3_bind_double(statement, column, number);
	default:
		return sqlite3_bind_text(statement, column, va_arg(*values, const char *), -1,
		                         SQLITE_TRANSIENT);
	}
}

static int archive_sql_query(struct archive *archive, sqlite3_stmt **statement, const char *text,
                             const char *types, va_list *values)
{
	int result = sqlite3_prepare_v2(archive->index, text, -1, statement, NULL);

	for (int i = 0; result == SQLITE_OK && types[i] != '\0'; i++)
		result = bind_one(*statement, i + 1, types[i], values);
	if (result == SQLITE_OK)
		return 0;
	result = sql_refuse(archive);
	sqlite3_finalize(*statement);
	return result;
}

int sql_query(struct archive *archive, sqlite3_stmt **statement, const char *text, const char *types, ...)
{
	va_list values;
	int result;

	va_start(values, types);
	result = archive_sql_query(archive, statement, text, types, &values);
	va_end(values);
	return result;
}

int sql_bind_text(struct archive *archive, sqlite3_stmt *statement, int column, const char *text)
{
	return sqlite3_bind_text(statement, column, text, -1, SQLITE_TRANSIENT) == SQLITE_OK
	               ? 0
	               : sql_refuse(archive);
}

int sql_step(struct archive *archive, sqlite3_stmt *statement)
{
	int result;

	if (sqlite3_errcode(archive->index) == SQLITE_NOMEM) /* a text of the row before had no memory */
		return sql_refuse(archive);
	result = sqlite3_step(statement);
	if (result == SQLITE_ROW)
		return 1;
	return result == SQLITE_DONE ? 0 : sql_refuse(archive);
}

int sql_run(struct archive *archive, const char *text, const char *types, ...)
{
	sqlite3_stmt *statement;
	va_list values;
	int result;

	va_start(values, types);
	result = archive_sql_query(archive, &statement, text, types, &values);
	va_end(values);
	if (result != 0)
		return result;
	do
		result = sql_step(archive, statement);
	while (result > 0);
	sqlite3_finalize(statement);
	return result;
}

int sql_script(struct archive *archive, const char *text)
{
	return sqlite3_exec(archive->index, text, NULL, NULL, NULL) == SQLITE_OK ? 0 : sql_refuse(archive);
}

int sql_number(struct archive *archive, int64_t *number, const char *text, const char *types, ...)
{
	sqlite3_stmt *statement;
	va_list values;
	int result;

	va_start(values, types);
	result = archive_sql_query(archive, &statement, text, types, &values);
	va_end(values);
	if (result != 0)
		return result;
	result = sql_step(archive, statement);
	if (result > 0)
		*number = sqlite3_column_int64(statement, 0);
	sqlite3_finalize(statement);
	if (result < 0)
		return result;
	return result > 0 ? 0 : DT_E_EMPTY;
}

const char *sql_text(sqlite3_stmt *statement, int column)
{
	const unsigned char *text = sqlite3_column_text(statement, column);

	return text != NULL ? (const char *)text : "";
}

int archive_start(struct archive *archive)
{
	return sql_script(archive, "BEGIN IMMEDIATE");
}

int archive_end(struct archive *archive, int result)
{
	if (result == 0)
		result = sql_script(archive, "COMMIT");
	if (result != 0 && !sqlite3_get_autocommit(archive->index))
		(void)sqlite3_exec(archive->index, "ROLLBACK", NULL, NULL, NULL);
	return result;
}
